"""Statements of dataset.toml, table by table, with checked values."""
