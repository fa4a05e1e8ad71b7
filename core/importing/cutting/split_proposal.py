"""Splits proposed by the kinds of the sequences."""

from __future__ import annotations

import re
from collections.abc import Sequence

from palpate.importing.rules import SequenceWindow

__all__ = ["proposed_splits"]


def proposed_splits(windows: Sequence[SequenceWindow]) -> dict[str, list[str]]:
    """Propose splits: the pushes of each kind train and test in turn, the first trains.

    Of the first kind with three or more the second one validates. Traces are in no split.
    """
    splits: dict[str, list[str]] = {"train": [], "validation": [], "test": []}
    pushes = [one for one in windows if one.kind != "trace"] or list(windows)
    kinds: dict[str, list[str]] = {}
    for one in pushes:
        kinds.setdefault(one.kind or _stem(one.name), []).append(one.name)
    for names in kinds.values():
        if len(names) > 2 and not splits["validation"]:
            splits["validation"].append(names.pop(1))
        splits["train"] += names[::2]
        splits["test"] += names[1::2]
    return splits


def _stem(name: str) -> str:
    return re.sub(r"[-_.]?\d+$", "", name)
