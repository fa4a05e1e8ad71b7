"""Prediction of a sequence with clouds: gaps of surface patches, forces, and their Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.history_replay import HistoryReplay, longest_step, without_history
from palpate.diagnosis.forward.jacobian import JacobianColumns, JacobianRequest
from palpate.diagnosis.forward.ray_comparison import (
    PointComparison,
    PointSample,
    choose_points,
    compare,
)
from palpate.diagnosis.forward.tool_path import ToolPath, tool_path_of
from palpate.diagnosis.observation.force_record import ForceComparison
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.measurement.patch_averages import PatchMeans
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = ["PointSample", "Prediction", "predict"]


@dataclass(frozen=True, eq=False)
class Prediction:
    """One sequence under one setup: g groups, p surface patches, k columns of the Jacobian.

    Attributes:
        name: of the sequence.
        gap: (g, p) mean of measured minus simulated distance [m]; NaN without points.
        count: (g, p) number of points.
        spread: (g, p) standard deviation of single points [m].
        columns: (g, p, k) change of gap: `TOOL_COLUMNS`, then setups, then inclusions.
        equilibria: one for each group.
        samples: points of each group, for the predictions of other models; empty without clouds.
        forces: comparison of forces; None where none were measured.
        other_side: (g, p) share of the points that meet another side of this model than of the
            model that chose them [1]; None without points.
        solves: number of equilibria that were solved.
    """

    name: str
    gap: FloatArray
    count: FloatArray
    spread: FloatArray
    columns: FloatArray
    equilibria: tuple[Equilibrium, ...]
    samples: tuple[PointSample, ...]
    forces: ForceComparison | None = None
    other_side: FloatArray | None = None
    solves: int = 0

    @property
    def force_only(self) -> bool:
        """Whether the sequence has forces and no clouds."""
        return not self.gap.shape[1]

    @property
    def failed(self) -> tuple[int, ...]:
        """Numbers of the groups without equilibrium."""
        return tuple(
            i for i, frame in enumerate(self.equilibria) if frame.outcome is not Outcome.CONVERGED
        )

    def of_groups(self, index: Sequence[int]) -> Prediction:
        """Return the prediction of these groups alone."""
        own = list(index)
        frames = tuple(self.equilibria[row] for row in own)
        points = tuple(self.samples[row] for row in own) if self.samples else ()
        forces = None if self.forces is None else self.forces.of_groups(own)
        seen = (self.gap[own], self.count[own], self.spread[own], self.columns[own])
        return Prediction(
            self.name,
            *seen,
            frames,
            points,
            forces,
            None if self.other_side is None else self.other_side[own],
        )

    def replace_columns(self, columns: FloatArray) -> Prediction:
        """Return it with other columns (g, p, k), or (g, p + 3, k) with the force's rows last."""
        patches = self.gap.shape[1]
        forces = None if self.forces is None else replace(self.forces, columns=columns[:, patches:])
        return replace(self, columns=columns[:, :patches], forces=forces)

    def append_columns(self, surface: FloatArray, force: FloatArray | None = None) -> Prediction:
        """Append columns: of the surface's gap (g, p, m), and of the force's gap (g, 3, m), which
        are zero without them.
        """
        columns = np.concatenate([self.columns, surface], axis=2)
        if self.forces is None:
            return replace(self, columns=columns)
        none = np.zeros((len(surface), 3, surface.shape[2]))
        return replace(
            self,
            columns=columns,
            forces=self.forces.append_columns(none if force is None else force),
        )

    def replace_column(self, other: Prediction, column: int, step: float) -> Prediction:
        """Replace a column by the difference of another setup's prediction over its step."""
        surface, force = other.change_from(self)
        columns = [self.columns] if self.forces is None else [self.columns, self.forces.columns]
        changed = np.concatenate(columns, axis=1)
        changed[..., column] = (
            surface if force is None else np.concatenate([surface, force], axis=1)
        ) / step
        return self.replace_columns(changed)

    def transferred(self, base: Prediction, origin: Prediction) -> Prediction:
        """Add this model's change from `origin` to `base`, which is on another mesh."""
        forces = self.forces
        if forces is not None and base.forces is not None and origin.forces is not None:
            forces = replace(forces, gap=base.forces.gap + forces.gap - origin.forces.gap)
        return replace(self, gap=base.gap + self.gap - origin.gap, forces=forces)

    def without_details(self) -> Prediction:
        """Drop columns, equilibria and samples, which take most of the memory."""
        return replace(self, columns=self.columns[..., :0], equilibria=(), samples=())

    def change_from(self, origin: Prediction) -> tuple[FloatArray, FloatArray | None]:
        """Gaps minus those of another model: of the surface (g, p) [m] and of the force (g, 3)
        [N]; zero where there is no measurement.
        """
        forces = (
            None
            if self.forces is None or origin.forces is None
            else np.nan_to_num(self.forces.gap - origin.forces.gap)
        )
        return np.nan_to_num(self.gap - origin.gap), forces


@dataclass(frozen=True, eq=False)
class _GroupResult:
    """One group's equilibrium, patch averages, and columns; see `Prediction`.

    Attributes:
        frame: equilibrium without the steps that led to it.
        sample: points that were compared.
        means: patch averages of the gaps.
        other_side: (p,) [1].
        columns: (p, k) change of the gaps; None if no Jacobian was requested.
        force_columns: (3, k) change of the force's gap; None also without measured forces.
    """

    frame: Equilibrium
    sample: PointSample
    means: PatchMeans
    other_side: FloatArray
    columns: FloatArray | None
    force_columns: FloatArray | None


def predict(
    data: Observations,
    setup: Setup,
    grid: Meshing,
    request: JacobianRequest | None = None,
    starts: Sequence[Equilibrium] | None = None,
    tolerance: float = CRITERIA.replay.tolerance,
    samples: Sequence[PointSample] | None = None,
) -> Prediction:
    """Replay a sequence's groups and compare each with its points.

    Args:
        data: the sequence.
        setup: under which it is replayed.
        grid: the mesh.
        request: the columns of the Jacobian that are computed; none without it.
        starts: equilibria of a similar setup, one for each group, as initial guesses.
        tolerance: of the replay, over the tool's push [1].
        samples: points to average, one sample for each group; chosen by this model without them.
    """
    surface, block = setup.surface(), Replay(setup, grid, tolerance, longest_step(setup))
    path = tool_path_of(data, setup, grid, request)
    with_forces = path.measured is not None
    columns = (
        JacobianColumns(block, request, with_forces) if request and not setup.has_history else None
    )
    history = HistoryReplay(data, block, path.correction) if setup.has_history else None
    results: list[_GroupResult] = []
    previous: Equilibrium | None = None
    for number, (group, centre, deepest) in enumerate(
        zip(data.groups, path.centres, path.deepest, strict=True)
    ):
        if deepest is not None:
            passed = block.step(deepest[0], previous)
            if columns is not None:
                columns.passed(passed, deepest[1])
        if history is not None:
            frame = history.reach(centre, data.instant(group, setup))
        else:
            start = starts[number] if starts is not None and starts[number].in_contact else previous
            frame = block.solve_from_any(centre, (start, previous))
        previous = frame if frame.outcome is Outcome.CONVERGED else None
        sample = (
            samples[number] if samples is not None else choose_points(group, setup, frame, surface)
        )
        compared = compare(group, setup, frame, surface, sample)
        own, force = (
            (None, None)
            if columns is None
            else _group_columns(columns, frame, compared, path, number, group.reference)
        )
        results.append(
            _GroupResult(
                replace(frame, path=()),
                sample,
                compared.means,
                compared.other_side(sample),
                own,
                force,
            )
        )
    solves = len(results) if history is None else history.solves
    prediction = replace(_collected(data, results, path), solves=solves)
    if request is None or history is None:
        return prediction
    # A small change of a parameter changes the whole history, which is no first-order change of
    # one frame. The columns are those of the setup without history.
    plain = replace(request, setups=tuple(without_history(other) for other in request.setups))
    return _with_columns_of(
        prediction,
        predict(data, without_history(setup), grid, plain, starts, tolerance, prediction.samples),
    )


def _group_columns(
    columns: JacobianColumns,
    frame: Equilibrium,
    compared: PointComparison,
    path: ToolPath,
    number: int,
    reference: bool,
) -> tuple[FloatArray, FloatArray | None]:
    """Changes of a group's patch averages (p, k) and force gap (3, k), in single precision."""
    moves = path.moves[:, number]
    changed = columns.of_group(frame, moves)
    own: Any = columns.project(frame, changed, moves, compared, reference).astype(np.float32)
    if path.measured is None:
        return own, None
    force: Any = columns.of_force(changed, path.measured[0][number], path.rotations)
    return own, force.astype(np.float32)


def _collected(data: Observations, results: Sequence[_GroupResult], path: ToolPath) -> Prediction:
    """The prediction of a sequence from the results of its groups."""
    gap = np.array([one.means.mean for one in results])
    own = [one.columns for one in results if one.columns is not None]
    force = [one.force_columns for one in results if one.force_columns is not None]
    columns: FloatArray = np.stack(own) if own else np.zeros((*gap.shape, 0))
    frames = tuple(one.frame for one in results)
    return Prediction(
        data.name,
        gap,
        np.array([one.means.count for one in results], dtype=float),
        np.array([one.means.spread for one in results]),
        columns,
        frames,
        tuple(one.sample for one in results),
        None if path.measured is None else ForceComparison.of(path.measured, frames, force),
        np.array([one.other_side for one in results]),
    )


def _with_columns_of(prediction: Prediction, other: Prediction) -> Prediction:
    """A prediction with the columns of another one."""
    solves = prediction.solves + other.solves
    if prediction.forces is None or other.forces is None:
        return replace(prediction, columns=other.columns, solves=solves)
    forces = replace(prediction.forces, columns=other.forces.columns)
    return replace(prediction, columns=other.columns, forces=forces, solves=solves)
