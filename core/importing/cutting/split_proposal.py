"""Splits proposed by the kinds of the sequences."""

from __future__ import annotations

import re
from collections.abc import Sequence

from palpate.importing.rules import SequenceWindow

__all__ = ["proposed_splits"]


def proposed_splits(windows: Sequence[SequenceWindow]) -> dict[str, list[str]]:
    """Propose splits: of each kind the first trains, a second push from the top validates, others
    test; traces are in none.

    A single sequence trains; of two the second tests.
    """
    splits: dict[str, list[str]] = {"train": [], "validation": [], "test": []}
    seen: dict[str, int] = {}
    pushes = [one for one in windows if one.kind != "trace"] or list(windows)
    for one in pushes:
        kind = one.kind or _stem(one.name)
        number = seen[kind] = seen.get(kind, 0) + 1
        if number == 1:
            splits["train"].append(one.name)
        elif number == 2 and not splits["validation"] and len(pushes) > 2:
            splits["validation"].append(one.name)
        else:
            splits["test"].append(one.name)
    return splits


def _stem(name: str) -> str:
    return re.sub(r"[-_.]?\d+$", "", name)
