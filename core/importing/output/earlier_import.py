"""Digests of sources and sequences, by which an import takes over what did not change."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from palpate.importing.output.written_dataset import IMPORTED, folder_size
from palpate.importing.rules import ImportMapping, SequenceWindow

__all__ = ["EarlierImport", "file_digests", "window_digest"]

_VERSION = 1
"""Changes with the way in which samples are decoded, so that older sequences are made anew."""


@dataclass(frozen=True)
class EarlierImport:
    """The import that made a dataset.

    Attributes:
        folder: of the dataset.
        sources: size, time of change and digest by file.
        sequences: digest and size by name.
    """

    folder: Path
    sources: dict[str, dict[str, object]] = field(default_factory=dict)
    sequences: dict[str, dict[str, object]] = field(default_factory=dict)

    @classmethod
    def of(cls, folder: Path) -> EarlierImport:
        """Read what an import noted in a dataset; empty without, or where it is damaged."""
        try:
            noted: Any = json.loads((folder / IMPORTED).read_text(encoding="utf-8"))
            files = {file: one for part in noted["sources"].values() for file, one in part.items()}
            return cls(folder, files, dict(noted["sequences"]))
        except (OSError, ValueError, KeyError, AttributeError, TypeError):
            return cls(folder)

    def sequence_with(self, digest: str) -> str | None:
        """Name of the sequence of this digest, whose files have the size that was noted."""
        for name, one in self.sequences.items():
            if one.get("digest") == digest:
                size = folder_size(self.folder / "sequences" / name)
                return name if size == one.get("size") else None
        return None


def file_digests(files: Iterable[Path], earlier: EarlierImport) -> dict[str, dict[str, object]]:
    """Size [bytes], time of change [ns] and SHA-256 of files by their paths.

    A file of the size and time that the earlier import noted is not read again.
    """
    found: dict[str, dict[str, object]] = {}
    for file in files:
        state = file.stat()
        known = earlier.sources.get(str(file.resolve()), {})
        if known.get("size") == state.st_size and known.get("changed") == state.st_mtime_ns:
            found[str(file.resolve())] = known
            continue
        with file.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        found[str(file.resolve())] = {
            "size": state.st_size,
            "changed": state.st_mtime_ns,
            "sha256": digest,
        }
    return found


def window_digest(
    window: SequenceWindow, sources: dict[str, dict[str, object]], mapping: ImportMapping
) -> str:
    """Digest of all that a sequence is made of: sources, meaning of streams, and the cut."""
    rules = mapping.model_dump(mode="json", include={"streams", "pose", "wrench", "time", "tables"})
    made_of = {
        "version": _VERSION,
        "sources": [one["sha256"] for _, one in sorted(sources.items())],
        "rules": rules,
        "start": window.start,
        "end": window.end,
        # The zero of forces is fitted before the first contact, which the setup places.
        "setup": mapping.setup if mapping.wrench.zero == "fitted" else None,
    }
    return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()
