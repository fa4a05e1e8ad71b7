"""The verbs of the terminal; each calls the same functions as the service."""
