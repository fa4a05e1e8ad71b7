"""Forces of a sequence without clouds under one setup, and how they would change with anything that might be wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.diagnosis.columns import Columns, Wanted
from core.diagnosis.force import Felt
from core.diagnosis.leading import led
from core.diagnosis.observations import Observations
from core.diagnosis.ordered import forgetful
from core.diagnosis.prediction import Prediction
from core.errors import DiagnosisError
from core.fem.newton import Outcome
from core.frames import FloatArray
from core.meshing import Meshing
from core.replay import Equilibrium, Replay
from core.setup import Setup

__all__ = ["predict_forces"]


def predict_forces(
    data: Observations,
    setup: Setup,
    grid: Meshing,
    wanted: Wanted | None = None,
    starts: Sequence[Equilibrium] | None = None,
    tolerance: float = 3e-4,
) -> Prediction:
    """Replay a sequence's pushes and compare the forces; of the surface nothing is predicted, as nothing of it was seen.

    Each push begins from rest. What hangs on all that was done before is left out: between short pushes a body recovers.

    Args:
        starts: equilibria of a similar setup, one per group, to begin from. wanted: changes to state; none without it.
    """
    setup = forgetful(setup)
    block, way = Replay(setup, grid, tolerance), led(data, setup, grid, wanted)
    if way.measured is None:
        raise DiagnosisError(f"{data.name}: has neither clouds nor forces")
    columns = None if wanted is None else Columns(block, wanted, felt=True)
    frames: list[Equilibrium] = []
    changes: list[FloatArray] = []
    for number, (group, centre) in enumerate(zip(data.groups, way.centres, strict=True)):
        same = bool(number) and data.groups[number - 1].probe == group.probe
        begin = [frames[-1]] if same and frames[-1].outcome is Outcome.CONVERGED else []
        if starts is not None and starts[number].in_contact:
            begin.insert(0, starts[number])
        frame = block.sought(centre, begin or [None])
        frames.append(frame)
        if columns is not None:
            changed = columns.of_group(frame, way.moves[:, number])
            changes.append(columns.of_force(changed, way.measured[0][number], way.turned).astype(np.float32))
    rows, count = len(frames), columns.count if columns is not None else 0
    nothing = np.zeros((rows, 0))
    felt = Felt.of(way.measured, frames, changes, np.array([group.probe for group in data.groups]))
    return Prediction(data.name, nothing, nothing, nothing, np.zeros((rows, 0, count)), tuple(frames), (), felt)
