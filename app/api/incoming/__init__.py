"""REST of what is brought to the server: archives, folders, recordings, and looks at them."""
