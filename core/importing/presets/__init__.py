"""Layouts of public recordings, one class each, chosen by their look or by name."""
