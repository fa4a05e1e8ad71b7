"""No file of Palpate is ever loaded under two module names, spawned processes included."""

from __future__ import annotations

import importlib
import sys
from collections import defaultdict
from pathlib import Path
from typing import Literal

import pytest

from palpate.foundation.processes import ProcessPool

ENTRIES = ("palpate.app.main", "palpate.app.cli", "palpate.app.jobs.tasks", "palpate.diagnosis")


def names_by_file() -> dict[str, list[str]]:
    """Import names of the loaded modules of Palpate, by file."""
    folders = [Path(path) for name in ("palpate", "palpate.app") for path in _paths(name)]
    names: dict[str, list[str]] = defaultdict(list)
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file and name != "__main__" and any(Path(file).is_relative_to(one) for one in folders):
            names[file].append(name)
    return dict(names)


def names_after_imports() -> dict[str, list[str]]:
    """The same after the entry points were imported."""
    for entry in ENTRIES:
        importlib.import_module(entry)
    return names_by_file()


def wrong_names(names: dict[str, list[str]]) -> dict[str, list[str]]:
    """Files with more than one name, or with a name outside palpate."""
    return {
        file: known
        for file, known in names.items()
        if len(known) > 1 or not known[0].startswith("palpate")
    }


def test_each_file_has_one_name_in_this_process() -> None:
    names = names_after_imports()
    assert len(names) > 30
    assert wrong_names(names) == {}


@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_each_file_has_one_name_in_a_process_of_a_pool(
    start: Literal["spawn", "forkserver"],
) -> None:
    with ProcessPool(1, start=start) as pool:
        names = pool.submit(names_after_imports).result(120)
    assert len(names) > 30
    assert wrong_names(names) == {}


def _paths(name: str) -> list[str]:
    return list(importlib.import_module(name).__path__)
