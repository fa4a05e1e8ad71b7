"""The folder with the page's HTML, CSS and JavaScript."""

from __future__ import annotations

from pathlib import Path

__all__ = ["STATIC_FOLDER"]

STATIC_FOLDER = Path(__file__).resolve().parents[1] / "static"
"""The folder is beside this package in a checkout (static/ and app/) and in an installation
(palpate/static and palpate/app)."""
