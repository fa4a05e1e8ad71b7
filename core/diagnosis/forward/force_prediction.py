"""Prediction of a sequence with forces and no clouds under a setup, and its Jacobian."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.history_replay import without_history
from palpate.diagnosis.forward.jacobian import JacobianColumns, JacobianRequest
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.tool_path import tool_path_of
from palpate.diagnosis.observation.force_record import ForceComparison
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DiagnosisError
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = ["predict_forces"]


def predict_forces(
    data: Observations,
    setup: Setup,
    grid: Meshing,
    request: JacobianRequest | None = None,
    starts: Sequence[Equilibrium] | None = None,
    tolerance: float = CRITERIA.replay.tolerance,
) -> Prediction:
    """Replay a sequence's pushes and compare the forces; the prediction has no surface patches.

    Each push begins from rest, without history: between short pushes a body recovers.

    Args:
        data: the sequence.
        setup: under which it is replayed.
        grid: the mesh.
        request: the columns of the Jacobian that are computed; none without it.
        starts: equilibria of a similar setup, one for each group, as initial guesses.
        tolerance: of the replay, over the tool's push [1].

    Raises DiagnosisError if the sequence has no forces.
    """
    setup = without_history(setup)
    block, path = Replay(setup, grid, tolerance), tool_path_of(data, setup, grid, request)
    if path.measured is None:
        raise DiagnosisError(f"{data.name}: has neither clouds nor forces")
    columns = None if request is None else JacobianColumns(block, request, forces=True)
    frames: list[Equilibrium] = []
    changes: list[FloatArray] = []
    for number, (group, centre) in enumerate(zip(data.groups, path.centres, strict=True)):
        same = bool(number) and data.groups[number - 1].push == group.push
        begin = [frames[-1]] if same and frames[-1].outcome is Outcome.CONVERGED else []
        if starts is not None and starts[number].in_contact:
            begin.insert(0, starts[number])
        frame = block.solve_from_any(centre, begin or [None])
        frames.append(frame)
        if columns is not None:
            changed = columns.of_group(frame, path.moves[:, number])
            changes.append(
                columns.of_force(changed, path.measured[0][number], path.rotations).astype(
                    np.float32
                )
            )
    rows, count = len(frames), columns.count if columns is not None else 0
    nothing = np.zeros((rows, 0))
    forces = ForceComparison.of(
        path.measured,
        frames,
        changes,
        np.array([group.push for group in data.groups]),
        data.forces.offset if data.forces is not None else 0.0,
    )
    return Prediction(
        data.name, nothing, nothing, nothing, np.zeros((rows, 0, count)), tuple(frames), (), forces
    )
