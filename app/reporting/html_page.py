"""Self-contained HTML pages from templates: styles, tables and their cells."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from palpate.app.static_files import STATIC_FOLDER
from palpate.foundation.errors import RunError
from palpate.foundation.quantities import words

__all__ = ["Bar", "Cell", "Table", "render_page"]

_STYLES = STATIC_FOLDER / "css"


@dataclass(frozen=True)
class Cell:
    """Text of a table cell.

    Attributes:
        text: the main part.
        note: follows in a lighter colour.
        style: `b` for bold text, or a class of the text: met, missed or dim.
    """

    text: str
    note: str = ""
    style: str = ""


@dataclass(frozen=True)
class Bar:
    """A horizontal bar in a table cell.

    Attributes:
        percent: length [%] of the full width.
        style: class that gives the colour; empty for the plain one.
    """

    percent: float
    style: str = ""


@dataclass(frozen=True)
class Table:
    """A table as the templates draw it.

    Attributes:
        columns: headings.
        rows: cells; plain text or a Cell or Bar.
        numbers: indices of the columns that are aligned to the right.
        wrong: indices of the highlighted rows.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str | Cell | Bar]]
    numbers: Sequence[int] = ()
    wrong: Sequence[int] = ()


def render_page(template: str, styles: str, **values: Any) -> str:
    """Fill a template of this package; all values are escaped unless they are Markup.

    Args:
        template: name of a file in `templates`.
        styles: name of a style sheet in static/css, in addition to the common one.
        values: variables of the template.
    """
    css = "".join((_STYLES / f"{name}.css").read_text() for name in ("one-file", styles))
    page: str = _templates().get_template(template).render(css=Markup(_colours() + css), **values)
    return page + "\n"


@lru_cache(maxsize=1)
def _templates() -> Environment:
    environment = Environment(
        loader=PackageLoader("palpate.app.reporting"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["words"] = words
    environment.tests["cell"] = lambda value: isinstance(value, Cell)
    environment.tests["bar"] = lambda value: isinstance(value, Bar)
    return environment


def _colours() -> str:
    """The colour variables of base.css: light and, on a dark screen, dark; light on paper."""
    file = _STYLES / "base.css"
    text = file.read_text()
    light, dark = (
        re.search(rf"^{re.escape(head)} \{{(.*?)^\}}", text, re.M | re.S)
        for head in (":root", ':root[data-theme="dark"]')
    )
    if light is None or dark is None:
        raise RunError(f"{file} has no colours under :root", file=str(file))
    on_dark_screen = "@media screen and (prefers-color-scheme: dark)"
    return f":root {{{light[1]}}}\n{on_dark_screen} {{ :root {{{dark[1]}}} }}\n"
