"""The application around the science: command line, service, page."""

if __name__ != "palpate.app":
    raise ImportError(
        f"{__name__} is a folder of Palpate's sources: write 'import palpate.app' in its place",
        name=__name__,
    )
