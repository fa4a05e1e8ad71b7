"""Files and folders that hold recorded data: one class for each format."""
