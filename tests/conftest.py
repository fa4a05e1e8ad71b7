"""Order of the tests: the longest files first, so that no worker ends with one of them while the
others have nothing left.
"""

from __future__ import annotations

from pathlib import Path

import pytest

LONGEST = ("tests/loop", "tests/core/blind", "tests/core/diagnosis", "tests/app")


def _place(item: pytest.Item) -> int:
    where = Path(item.path).relative_to(item.config.rootpath).as_posix()
    return next(
        (place for place, start in enumerate(LONGEST) if where.startswith(start)), len(LONGEST)
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=_place)
