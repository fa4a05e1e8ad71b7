"""What pages share that need nothing but themselves: head and colours, sections, tables, and plots
in the page's colours.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from palpate.app.static_files import STATIC_FOLDER
from palpate.foundation.errors import RunError

__all__ = ["INK", "one_file", "section", "table", "themed"]

INK = {
    "text": "#010101",
    "text-3": "#020202",
    "line": "#030303",
    "extended": "#040404",
    "measured": "#050505",
    "raw": "#060606",
    "floor": "#070707",
}
"""Variables of the page, and the stand-ins that a plot is drawn with."""
_STYLES = STATIC_FOLDER / "css"


def one_file(title: str, body: str, *styles: str) -> str:
    """The whole page. `styles` names files of static/css, after the one that all have."""
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    css = _colours() + "".join(
        (_STYLES / f"{name}.css").read_text() for name in ("one-file", *styles)
    )
    return f'<!doctype html>\n<html lang="en"><head>{head}<style>{css}</style></head><body><main>{body}</main></body></html>\n'


def _colours() -> str:
    """The page's colours, light and dark, from the one place where they stand; on paper light."""
    text = (_STYLES / "base.css").read_text()
    light, dark = (
        re.search(rf"^{re.escape(head)} \{{(.*?)^\}}", text, re.M | re.S)
        for head in (":root", ':root[data-theme="dark"]')
    )
    if light is None or dark is None:
        raise RunError(
            f"{_STYLES / 'base.css'} has no colours under :root", file=str(_STYLES / "base.css")
        )
    return f":root {{{light[1]}}}\n@media screen and (prefers-color-scheme: dark) {{ :root {{{dark[1]}}} }}\n"


def section(title: str, note: str, body: str) -> str:
    """A heading, a line below it, and HTML."""
    return f"<section><h2>{title}</h2><p>{note}</p>{body}</section>"


def table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    numbers: Iterable[int] = (),
    wrong: Sequence[bool] = (),
) -> str:
    """Cells are HTML already; columns of these numbers are to the right."""
    right = set(numbers)
    mark = [' class="n"' if place in right else "" for place in range(len(columns))]
    head = "".join(f"<th{one}>{text}</th>" for one, text in zip(mark, columns, strict=True))
    lines = []
    for number, row in enumerate(rows):
        cells = "".join(f"<td{one}>{text}</td>" for one, text in zip(mark, row, strict=True))
        lines.append(
            f"<tr class='wrong'>{cells}</tr>" if wrong and wrong[number] else f"<tr>{cells}</tr>"
        )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"


def themed(drawn: Any) -> str:
    """Inline SVG without a background, with text as text, and with the page's variables for the
    stand-ins.
    """
    from matplotlib import rc_context

    for axes in drawn.axes:
        axes.patch.set_visible(False)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(INK["line"])
        axes.tick_params(colors=INK["text-3"], labelsize=9)
        axes.xaxis.label.set_color(INK["text-3"])
        axes.yaxis.label.set_color(INK["text-3"])
    drawn.patch.set_visible(False)
    text = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "palpate"}):
        drawn.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()[text.getvalue().index("<svg") :]
    for name, colour in INK.items():
        svg = svg.replace(colour, f"var(--{name})")
    svg = re.sub(
        r"font(-family)?: ([\d.]+px) [^;\"]*", r"font: \2 inherit; font-family: inherit", svg
    )
    return re.sub(r' (width|height)="[\d.]+pt"', "", svg, count=2)
