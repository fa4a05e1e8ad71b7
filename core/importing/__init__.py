"""Import of recordings: bags, tables and clouds become a dataset in format 1."""
