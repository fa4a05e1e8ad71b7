"""`python -m benchmarks [NAME ...]` runs all benchmarks, or those named."""

from __future__ import annotations

import sys

from rich.console import Console

from benchmarks import (
    cleaning,
    convergence,
    correcting,
    correction,
    dataset,
    diagnosis,
    effects,
    gradings,
    live,
    measurement,
    peers,
    picking,
    replay,
    scrub,
    service,
    shapes,
    tangent,
)

ALL = {
    "replay": replay.run,
    "tangent": tangent.run,
    "peers": peers.run,
    "gradings": gradings.run,
    "convergence": convergence.run,
    "shapes": shapes.run,
    "effects": effects.run,
    "measurement": measurement.run,
    "cleaning": cleaning.run,
    "picking": picking.run,
    "service": service.run,
    "dataset": dataset.run,
    "correction": correction.run,
    "correcting": correcting.run,
    "diagnosis": diagnosis.run,
    "live": live.run,
    "scrub": scrub.run,
}
WIDTH = 140
"""Characters of a line where there is no terminal to ask."""


def main(names: list[str]) -> int:
    """Run benchmarks by name, print their tables; 1 when a result is wrong, 2 when a name is
    unknown.
    """
    console, outcome = Console(width=None if sys.stdout.isatty() else WIDTH), 0
    unknown = [name for name in names if name not in ALL]
    if unknown:
        console.print(f"no benchmark is called {', '.join(unknown)}; known are {', '.join(ALL)}")
        return 2
    for name in names or ALL:
        try:
            console.print(*ALL[name](), sep="\n")
        except RuntimeError as error:
            console.print(f"[bold red]{name}[/]: {error}")
            outcome = 1
    return outcome


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
