"""One sequence under one setup: gaps by group and patch, and how they would change with anything
that might be wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.history_replay import Past, forgetful, travel
from palpate.diagnosis.forward.jacobian import Columns, Wanted
from palpate.diagnosis.forward.ray_comparison import PointSample, choose_points, compare
from palpate.diagnosis.forward.tool_path import tool_path_of
from palpate.diagnosis.observation.force_record import ForceComparison
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.measurement.surface_gaps import Surface
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = ["PointSample", "Prediction", "predict"]


@dataclass(frozen=True, eq=False)
class Prediction:
    """One sequence under one setup.

    Attributes:
        gap: (g, p) mean of measured minus simulated [m], NaN where unseen.
        count: (g, p) points.
        spread: (g, p) [m].
        columns: (g, p, k) change of gap: TOOL_COLUMNS, then setups, then lumps.
        elsewhere: (g, p) share of the points that meet another side of this model than of the one
            that chose them [1]; None where there are no points.
        equilibria: of each group.
        samples: of each group, for the predictions of other models; none without clouds, where
            there are no patches.
        felt: forces, if there are any.
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

    @property
    def force_only(self) -> bool:
        """Whether there are forces alone."""
        return not self.gap.shape[1]

    @property
    def failed(self) -> tuple[int, ...]:
        """Groups without equilibrium."""
        return tuple(
            i for i, frame in enumerate(self.equilibria) if frame.outcome is not Outcome.CONVERGED
        )

    def of_groups(self, index: Sequence[int]) -> Prediction:
        """These groups alone."""
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
        """With other columns (g, p, k), or (g, p + 3, k) where the last rows are the force's."""
        patches = self.gap.shape[1]
        forces = None if self.forces is None else replace(self.forces, columns=columns[:, patches:])
        return replace(self, columns=columns[:, :patches], forces=forces)

    def beside(self, surface: FloatArray, force: FloatArray | None = None) -> Prediction:
        """With further columns last: of the surface's gap (g, p, m), and of the force's (g, 3, m),
        which are else zero.
        """
        columns = np.concatenate([self.columns, surface], axis=2)
        if self.forces is None:
            return replace(self, columns=columns)
        none = np.zeros((len(surface), 3, surface.shape[2]))
        return replace(
            self, columns=columns, forces=self.forces.beside(none if force is None else force)
        )

    def replace_column(self, other: Prediction, column: int, step: float) -> Prediction:
        """With what another setup changes over its step in place of a column."""
        surface, force = other.change_from(self)
        columns = [self.columns] if self.forces is None else [self.columns, self.forces.columns]
        changed = np.concatenate(columns, axis=1)
        changed[..., column] = (
            surface if force is None else np.concatenate([surface, force], axis=1)
        ) / step
        return self.replace_columns(changed)

    def transferred(self, base: Prediction, origin: Prediction) -> Prediction:
        """With gaps as if what this model changes over `origin`, both on another mesh, had been
        done to `base`.
        """
        forces = self.forces
        if forces is not None and base.forces is not None and origin.forces is not None:
            forces = replace(forces, gap=base.forces.gap + forces.gap - origin.forces.gap)
        return replace(self, gap=base.gap + self.gap - origin.gap, forces=forces)

    def without_details(self) -> Prediction:
        """The gaps without what takes most of the memory: for what is only compared."""
        return replace(self, columns=self.columns[..., :0], equilibria=(), samples=())

    def change_from(self, origin: Prediction) -> tuple[FloatArray, FloatArray | None]:
        """What this model's gaps have over another's, of the surface (g, p) [m] and of the force
        (g, 3) [N]; zero where unseen.
        """
        forces = (
            None
            if self.forces is None or origin.forces is None
            else np.nan_to_num(self.forces.gap - origin.forces.gap)
        )
        return np.nan_to_num(self.gap - origin.gap), forces


def predict(
    data: Observations,
    setup: Setup,
    grid: Meshing,
    wanted: Wanted | None = None,
    starts: Sequence[Equilibrium] | None = None,
    tolerance: float = CRITERIA.replay.tolerance,
    samples: Sequence[PointSample] | None = None,
) -> Prediction:
    """Replay a sequence's groups and compare each with its points.

    Args:
        starts: equilibria of a similar setup, one per group, to begin from.
        wanted: changes to state; none without it.
        samples: which points to average; chosen anew without them.
    """
    surface, block = Surface.of(setup), Replay(setup, grid, tolerance, travel(setup))
    way = tool_path_of(data, setup, grid, wanted)
    true_from_stated, centres, moves, turned, measured = (
        way.correction,
        way.centres,
        way.moves,
        way.turned,
        way.measured,
    )
    columns = (
        Columns(block, wanted, measured is not None) if wanted and not setup.has_history else None
    )
    gap, count, spread, changes, pressed, frames, chosen, other_side = (
        [],
        [],
        [],
        [],
        [],
        [],
        [],
        [],
    )
    past = Past(data, block, true_from_stated) if setup.has_history else None
    previous: Equilibrium | None = None
    for number, (group, centre, turn) in enumerate(
        zip(data.groups, centres, way.turns, strict=True)
    ):
        if turn is not None:
            deepest = block.step(turn[0], previous)
            if columns is not None:
                columns.passed(deepest, turn[1])
        if past is not None:
            frame = past.reach(centre, data.instant(group, setup))
        else:
            start = starts[number] if starts is not None and starts[number].in_contact else previous
            frame = block.solve_from_any(centre, (start, previous))
        previous = frame if frame.outcome is Outcome.CONVERGED else None
        sample = (
            samples[number] if samples is not None else choose_points(group, setup, frame, surface)
        )
        compared = compare(group, setup, frame, surface, sample)
        chosen.append(sample)
        gap.append(compared.means.mean)
        count.append(compared.means.count)
        spread.append(compared.means.spread)
        other_side.append(compared.other_side(sample))
        frames.append(replace(frame, way=()))  # what was on the way to it is for this replay alone
        if columns is not None:
            moved = columns.of_group(frame, moves[:, number])
            changes.append(
                columns.project(frame, moved, moves[:, number], compared, group.reference).astype(
                    np.float32
                )
            )
            if measured is not None:
                pressed.append(
                    columns.of_force(moved, measured[0][number], turned).astype(np.float32)
                )
    stacked: FloatArray = np.stack(changes) if changes else np.zeros((len(gap), surface.patches, 0))
    if wanted and past is not None:
        # What a little change does to all that a frame hangs on is no first-order change of the
        # frame: it is stated without memory.
        plain = replace(wanted, setups=tuple(forgetful(other) for other in wanted.setups))
        forgotten = predict(data, forgetful(setup), grid, plain, starts, tolerance, chosen)
        stacked, pressed = (
            forgotten.columns,
            [] if forgotten.forces is None else list(forgotten.forces.columns),
        )
    return Prediction(
        data.name,
        np.array(gap),
        np.array(count, dtype=float),
        np.array(spread),
        stacked,
        tuple(frames),
        tuple(chosen),
        None if measured is None else ForceComparison.of(measured, frames, pressed),
        np.array(other_side),
    )
