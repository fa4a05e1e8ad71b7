"""Stamps of header, receipt and device brought to one time line."""
