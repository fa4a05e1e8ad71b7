"""Long lists by pages: `after` and `most` in the query, the whole number in a header, since a list stays a plain list."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Query

__all__ = ["TOTAL", "Page", "PageOf"]

TOTAL = "X-Total-Count"


@dataclass(frozen=True)
class Page:
    """Which part of a list: at most `most` rows from the `after`-th on."""

    after: int
    most: int


def _page(after: Annotated[int, Query(ge=0, le=10**9)] = 0, most: Annotated[int, Query(ge=1, le=1000)] = 200) -> Page:
    return Page(after, most)


PageOf = Annotated[Page, Depends(_page)]
