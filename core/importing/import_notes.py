"""Decisions and warnings of an import, one sentence each."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["ImportNotes"]


@dataclass
class ImportNotes:
    """Sentences in the order in which they were found, each once.

    Attributes:
        decisions: what was done and by which evidence.
        warnings: what the user should look at.
    """

    decisions: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def decide(self, text: str) -> None:
        """Add a decision."""
        if text not in self.decisions:
            self.decisions.append(text)

    def warn(self, text: str) -> None:
        """Add a warning."""
        if text not in self.warnings:
            self.warnings.append(text)
