"""Pages that are made while the documentation is built, from the code and from texts beside it."""

from __future__ import annotations

import inspect
import re
from itertools import groupby
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from palpate.diagnosis.criteria import CRITERIA, criteria_rows
from palpate.effects import CATALOGUE
from palpate.synthetic import NUISANCES
from palpate.synthetic.laws import SECOND_LAWS

ROOT = Path(__file__).resolve().parents[2]
REPOSITORY_LINK = re.compile(r"\[([^\]]+)\]\((?:\.\./)+[^)]*\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages."""
    pages = {
        "criteria.md": criteria_page(),
        "nuisances.md": nuisances_page(),
        "own-effects.md": (ROOT / "core/effects/README.md").read_text(encoding="utf-8"),
        "blind-suite.md": without_repository_links(ROOT / "benchmarks/blind/README.md"),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Fill the table of effects in."""
    if page.file.src_uri == "effects.md":
        return markdown.replace("<!-- parameters -->", parameter_table())
    return markdown


def without_repository_links(file: Path) -> str:
    """A text of the repository whose links to other folders are plain words here."""
    return REPOSITORY_LINK.sub(r"\1", file.read_text(encoding="utf-8"))


def criteria_page() -> str:
    """Every threshold of the diagnosis, by topic."""
    lines = [
        "# Criteria: every threshold of the diagnosis",
        "",
        f"Version {CRITERIA.version}; reports and `model.json` carry it. *Source* says where a "
        "value comes from: a measurement, a derivation, a reference, or that it was chosen.",
    ]
    for topic, rows in groupby(criteria_rows(), key=lambda row: row.name.partition(".")[0]):
        lines += ["", f"## {topic}", "", "| name | value | unit | meaning | source |"]
        lines += ["|---|---|---|---|---|"]
        lines += [
            f"| `{row.name.partition('.')[2]}` | {row.value} | {row.unit} | {cell(row.meaning)} "
            f"| {cell(row.source)} |"
            for row in rows
        ]
    return "\n".join(lines)


def nuisances_page() -> str:
    """Every nuisance of the virtual bench, from its class."""
    lines = [
        "# Nuisances of the virtual bench",
        "",
        "`palpate blind --nuisances` gives the virtual bench the faults that data sheets and "
        "public reports name. They are drawn from a random stream of their own; nothing is to be "
        "named for one, unless the table says what. `--camera d405` and `--filter temporal` set "
        "camera and filters. A filter can be declared in a dataset (`[camera] filters`).",
        "",
        "| nuisance | meaning and source | drawn | right names |",
        "|---|---|---|---|",
    ]
    for kind in NUISANCES:
        meaning = (inspect.getdoc(kind) or "").partition("Attributes:")[0]
        drawn = inspect.getdoc(kind.draw) or ""
        names = ", ".join(f"`{name}`" for name in kind.causes)
        lines.append(f"| `{kind.__name__}` | {cell(meaning)} | {cell(drawn)} | {names} |")
    lines += [
        "",
        "## Second laws",
        "",
        "With nuisances, a hidden effect follows another law than the catalogue's in half of the "
        "cases.",
        "",
        "| effect | second law | parameters that keep their meaning |",
        "|---|---|---|",
        *(
            f"| `{effect}` | {cell(law.summary)} | {', '.join(law.kept)} |"
            for effect, law in SECOND_LAWS.items()
        ),
    ]
    return "\n".join(lines)


def parameter_table() -> str:
    """Bounds and steps of the parameters of all effects, from the classes."""
    lines = ["| effect | parameter | unit | bounds | step that matters |", "|---|---|---|---|---|"]
    for effect in CATALOGUE:
        for item in effect.parameters():
            bounds = ", ".join(item.choices) or f"{item.low:g} to {item.high:g}"
            step = "" if item.choices else f"{item.scale:g}"
            lines.append(
                f"| `{effect.name}` | `{item.name}` | {item.unit} | {cell(bounds)} | {step} |"
            )
    return "\n".join(lines)


def cell(text: str) -> str:
    """Text that can stand in a table's cell."""
    return " ".join(text.split()).replace("|", "\\|")
