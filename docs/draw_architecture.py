#!/usr/bin/env python3
"""Draw the packages with their imports, as SVG: python docs/draw_architecture.py [FILE]

An arrow leads from a package to one that it imports. An import that follows from others (A imports
B, B imports C, so A may import C) is not drawn; imports of the foundation, which all have, are not.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

ROOT = Path(__file__).resolve().parents[1]
LINE, FILL, APP, INK = "#8a97a6", "#e8f3f1", "#eee9f7", "#22303c"


PLACES = {
    "app": (4.0, 8.4),
    "blind": (0.9, 7.4),
    "evaluation": (4.0, 7.4),
    "correction": (2.6, 6.4),
    "sweep": (7.1, 6.4),
    "diagnosis": (4.9, 6.4),
    "recording": (4.0, 5.4),
    "experiment": (4.0, 4.4),
    "synthetic": (0.9, 5.0),
    "effects": (3.0, 3.4),
    "first_look": (6.3, 5.4),
    "consistency": (7.1, 4.4),
    "importing": (7.1, 2.4),
    "measurement": (5.9, 3.4),
    "gradients": (0.9, 3.1),
    "registration": (4.9, 2.4),
    "replay": (2.6, 2.4),
    "dataset": (5.9, 1.4),
    "fem": (2.6, 1.4),
    "mesh": (2.6, 0.4),
    "setup": (4.6, 0.4),
    "foundation": (7.1, 0.4),
}
"""Where each package is drawn."""
TEXTS = {
    "app": "commands, service, jobs, page",
    "blind": "suite with hidden causes",
    "evaluation": "what network and cause are worth",
    "correction": "network on top of a model",
    "sweep": "error over parameters",
    "diagnosis": "names the cause",
    "recording": "replays for page and script",
    "experiment": "one dataset, registered",
    "synthetic": "virtual bench",
    "effects": "catalogue of causes",
    "first_look": "before any job",
    "consistency": "what is said twice",
    "importing": "recordings to a dataset",
    "measurement": "cloud against surface",
    "gradients": "first-order changes",
    "registration": "robot, camera, phantom",
    "replay": "a frame's equilibrium",
    "dataset": "folders and files",
    "fem": "elements, contact, Newton",
    "mesh": "graded grids, tetrahedra",
    "setup": "what is believed",
    "foundation": "errors, frames, processes",
}


def imports() -> Counter[tuple[str, str]]:
    """How many import statements lead from one package to another."""
    found: Counter[tuple[str, str]] = Counter()
    for folder in ("core", "app"):
        for path in (ROOT / folder).glob("*/**/*.py"):
            here = "app" if folder == "app" else path.relative_to(ROOT / folder).parts[0]
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("palpate."):
                    there = str(node.module).split(".")[1]
                    if there != here:
                        found[here, there] += 1
    return found


def direct(edges: set[tuple[str, str]]) -> list[tuple[str, str]]:
    """Edges that do not follow from others (transitive reduction of a graph without circles)."""
    after: dict[str, set[str]] = {}

    def reach(name: str) -> set[str]:
        if name not in after:
            nexts = {there for here, there in edges if here == name}
            after[name] = nexts.union(*(reach(there) for there in nexts))
        return after[name]

    return sorted(
        (here, there)
        for here, there in edges
        if not any(there in reach(other) for one, other in edges if one == here and other != there)
    )


def draw(file: Path) -> None:
    """Write the drawing; KeyError where a package has no place in it."""
    figure = Figure(figsize=(8.4, 8.9))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-0.2, 8.2), ylim=(-0.05, 8.85))
    axes.axis("off")
    packages = {path.parent.name for path in (ROOT / "core").glob("*/__init__.py")} | {"app"}
    edges = {(here, there) for here, there in imports() if "foundation" not in (here, there)}
    boxes = {}
    for name in sorted(packages):
        x, y = PLACES[name]
        boxes[name] = FancyBboxPatch(
            (x - 0.85, y - 0.22),
            1.7,
            0.44,
            boxstyle="round,pad=0.02,rounding_size=0.08",
            facecolor=APP if name == "app" else FILL,
            edgecolor=INK,
            linewidth=0.8,
            zorder=3,
        )
        axes.add_patch(boxes[name])
        axes.text(
            x, y + 0.06, name, ha="center", va="center", fontsize=10.5, weight="bold", zorder=4
        )
        axes.text(x, y - 0.11, TEXTS[name], ha="center", va="center", fontsize=6.8, zorder=4)
    for here, there in direct(edges):
        axes.add_patch(
            FancyArrowPatch(
                PLACES[here],
                PLACES[there],
                patchA=boxes[here],
                patchB=boxes[there],
                shrinkA=1,
                shrinkB=2,
                arrowstyle="-|>",
                mutation_scale=11,
                linewidth=1.1,
                color=LINE,
            )
        )
    file.parent.mkdir(parents=True, exist_ok=True)
    # The same drawing is the same file: without a salt its marks have other names each time.
    with rc_context({"svg.hashsalt": "palpate"}):
        figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pages" / "architecture.svg")
