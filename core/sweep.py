"""Many parameter sets of one motion, in the way that is fastest on a device.

On a processor that is one replay after another: each follows its own factor for several frames, while a batch, which cannot, makes
one a step (`python -m benchmarks sweep` times both). On a graphics card it is a batch.
"""

from __future__ import annotations

from collections.abc import Sequence

from core.equilibrium import Equilibrium
from core.fem.newton import RELATIVE_TOLERANCE
from core.frames import FloatArray
from core.mesh import GridSpec
from core.progress import Report, part, silent
from core.replay import replay
from core.setup import Setup

__all__ = ["sweep"]


def sweep(
    setups: Sequence[Setup],
    centres: FloatArray,
    grid: GridSpec,
    *,
    device: str = "cpu",
    tolerance: float = RELATIVE_TOLERANCE,
    report: Report = silent,
) -> list[list[Equilibrium]]:
    """One replay per setup, of the tool at stated centres (f, 3) [m], phantom frame; `device` is "cpu", or one that torch knows.

    Other arguments as for `core.replay.replay`.
    """
    if device != "cpu":
        from core.batch import replay_batch  # noqa: PLC0415 (heavy)

        return replay_batch(setups, centres, grid, device=device, tolerance=tolerance, report=report)
    count = len(setups)
    return [
        replay(setup, centres, grid, tolerance=tolerance, report=part(report, number / count, (number + 1) / count))
        for number, setup in enumerate(setups)
    ]
