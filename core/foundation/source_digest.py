"""Digest of the sources, which tells stored results by the code that made them."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

__all__ = ["EXCLUDED", "source_digest"]

EXCLUDED = (
    "app",
    "blind",
    "correction",
    "evaluation",
    "recording/interactive.py",
    "recording/resolve_frame.py",
    "static",
    "sweep",
)
"""Folders and files that neither a diagnosis nor the making of data imports."""


@cache
def source_digest(*folders: str, excluded: tuple[str, ...] = EXCLUDED) -> str:
    """Compute the digest (12 hex digits) of all sources that a diagnosis or a virtual dataset uses.

    Args:
        folders: only these folders of `core` count; all without any.
        excluded: folders and files that do not count; the usual ones may change without making
            old diagnoses and datasets invalid.
    """
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if folders and not name.startswith(tuple(f"{folder}/" for folder in folders)):
            continue
        if not any(name == user or name.startswith(f"{user}/") for user in excluded):
            digest.update(f"{name}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:12]
