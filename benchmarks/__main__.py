"""Command line: `python -m benchmarks [NAME ...]` runs all benchmarks, or those named."""

from __future__ import annotations

import sys

from rich.console import Console

from benchmarks import (
    cleaning,
    convergence,
    correction_benefit,
    correction_speed,
    dataset_reading,
    diagnosis,
    effect_sizes,
    interactive,
    measurement,
    mesh_grading,
    newton_step,
    other_engines,
    picking,
    recording_import,
    replay,
    scrubbing,
    segmentation,
    shape_accuracy,
    sweep_service,
    tetrahedra,
)

ALL = {
    "replay": replay.run,
    "newton_step": newton_step.run,
    "other_engines": other_engines.run,
    "mesh_grading": mesh_grading.run,
    "convergence": convergence.run,
    "tetrahedra": tetrahedra.run,
    "shape_accuracy": shape_accuracy.run,
    "effect_sizes": effect_sizes.run,
    "measurement": measurement.run,
    "segmentation": segmentation.run,
    "cleaning": cleaning.run,
    "picking": picking.run,
    "sweep_service": sweep_service.run,
    "dataset_reading": dataset_reading.run,
    "recording_import": recording_import.run,
    "correction_speed": correction_speed.run,
    "correction_benefit": correction_benefit.run,
    "diagnosis": diagnosis.run,
    "interactive": interactive.run,
    "scrubbing": scrubbing.run,
}
WIDTH = 140
"""Characters of a line where there is no terminal to ask."""


def main(names: list[str]) -> int:
    """Run benchmarks by name and print their tables.

    Returns 0, 1 where a result is wrong, or 2 for an unknown name.
    """
    console, status = Console(width=None if sys.stdout.isatty() else WIDTH), 0
    unknown = [name for name in names if name not in ALL]
    if unknown:
        console.print(f"no benchmark is called {', '.join(unknown)}; known are {', '.join(ALL)}")
        return 2
    for name in names or ALL:
        try:
            console.print(*ALL[name](), sep="\n")
        except RuntimeError as error:
            console.print(f"[bold red]{name}[/]: {error}")
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
