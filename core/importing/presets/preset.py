"""The protocol of presets: layouts of recordings that others have published."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from palpate.importing.import_notes import ImportNotes
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping

__all__ = ["Preset", "with_setup"]


class Preset(Protocol):
    """One layout.

    Attributes:
        name: by which it is chosen.
        summary: what it is, for a person.
    """

    name: str
    summary: str

    def fits(self, path: Path) -> bool:
        """Whether a file or folder looks like it."""
        ...

    def recordings(self, path: Path) -> list[Recording]:
        """Open its recordings."""
        ...

    def completed(self, mapping: ImportMapping, path: Path, notes: ImportNotes) -> ImportMapping:
        """Add what holds for all recordings of this layout to a proposal."""
        ...


def with_setup(
    mapping: ImportMapping, tables: dict[str, dict[str, object]], folder: Path
) -> ImportMapping:
    """Add tables of dataset.toml; what is stated already goes first.

    Args:
        mapping: that is completed.
        tables: keys by table.
        folder: of the files that they name, taken where no setup is stated.
    """
    setup = {name: {**keys, **mapping.setup.get(name, {})} for name, keys in tables.items()}
    changed: dict[str, object] = {"setup": {**mapping.setup, **setup}}
    if not mapping.setup_folder:
        changed["setup_folder"] = str(folder)
    return mapping.model_copy(update=changed)
