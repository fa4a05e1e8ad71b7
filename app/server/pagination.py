"""Pagination of lists: `after` and `most` in the query, the total number in a header."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, TypeVar

from fastapi import Depends, Query, Response

__all__ = ["TOTAL", "Page", "RequestedPage", "paginate"]

TOTAL = "X-Total-Count"
T = TypeVar("T")


@dataclass(frozen=True)
class Page:
    """A part of a list: at most `most` rows from the `after`-th on."""

    after: int
    most: int


def _page(
    after: Annotated[int, Query(ge=0, le=10**9)] = 0,
    most: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> Page:
    return Page(after, most)


RequestedPage = Annotated[Page, Depends(_page)]


def paginate(rows: Sequence[T], page: Page, response: Response) -> Sequence[T]:
    """The requested part of a list; the total number goes into the answer's header."""
    response.headers[TOTAL] = str(len(rows))
    return rows[page.after : page.after + page.most]
