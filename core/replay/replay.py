"""Replay of a tool's motion: one converged equilibrium per frame, or a sentence that says why not.

The block has no history, except a material with history (`palpate.replay.material_history`) and a
base that slips, whose position depends on earlier pushes. A graded mesh follows the tool: each
frame has its own node coordinates, and starts from the frame before, interpolated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from time import monotonic

import numpy as np
from numpy.typing import ArrayLike

from palpate.fem.model import ToolSphere
from palpate.fem.newton import RELATIVE_TOLERANCE, Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError, SolveError
from palpate.foundation.progress import Report, silent
from palpate.foundation.threads import on_one_thread
from palpate.mesh.protocol import Meshing
from palpate.replay.compliance_and_slip import GRAVITY, slip_step, solve_compliant_tool, weight_of
from palpate.replay.equilibrium import Equilibrium, require_converged
from palpate.replay.fixed_base import FixedBaseReplay
from palpate.replay.material_history import ReplayState
from palpate.replay.work_budget import WorkSpentError
from palpate.setup.setup import Setup

__all__ = ["GRAVITY", "Equilibrium", "Replay", "replay", "require_converged", "rest"]

_MOST_SLIDES, _DRAG_STEP, _TELLING = 40, 1e-3, 2.0
"""Largest number of base-slip iterations per frame; default of `drag_step`: longest motion of a
tool with friction in one substep [m]; and time after which a replay tells what is left [s]."""


class Replay(FixedBaseReplay):
    """A block under a tool that moves from position to position.

    Args:
        setup: the experiment as assumed.
        grid: the mesh, unless the setup has one.
        tolerance: relative residual of a converged frame.
        drag_step: longest motion of a tool with friction that is taken as straight [m].
    """

    def __init__(
        self,
        setup: Setup,
        grid: Meshing,
        tolerance: float = RELATIVE_TOLERANCE,
        drag_step: float = _DRAG_STEP,
    ) -> None:
        super().__init__(setup, grid, tolerance)
        self._offset, self._drag_step = np.array(setup.tool.offset), drag_step

    def _advance(self, tool: ToolSphere, start: Equilibrium) -> Equilibrium:
        """Solve for the equilibrium at `tool`.

        With friction, intermediate positions are so close that the path of each surface point
        between two is known.
        """
        if not self.setup.tool.friction_coefficient:
            return self.solve_with_fixed_base(tool, start)
        slip = np.append(self.slip, 0.0)
        begin = (
            self.approach_start(start, ToolSphere(tool.centre - slip, tool.radius)).centre + slip
        )
        steps = max(1, int(np.ceil(float(np.linalg.norm(tool.centre - begin)) / self._drag_step)))
        path = [start]
        for share in np.arange(1, steps + 1) / steps:
            path.append(
                self.solve_with_fixed_base(
                    ToolSphere(begin + share * (tool.centre - begin), tool.radius), path[-1]
                )
            )
            if path[-1].outcome is not Outcome.CONVERGED:
                break
        return self._with_path(path[1:-1], path[-1])

    def _with_path(self, path: Sequence[Equilibrium], frame: Equilibrium) -> Equilibrium:
        """A frame with the equilibria on the path to it."""
        result = replace(frame, path=tuple(path))
        if self._before is not None and self._before[1] is frame:
            self._before = (self._before[0], result)
        return result

    @on_one_thread
    def step(
        self, stated_centre: FloatArray, start: Equilibrium | None = None, time: float | None = None
    ) -> Equilibrium:
        """Solve for the equilibrium with the tool at a stated centre; tool and base move if they
        can.

        A material with history needs the time, and continues from its last equilibrium, whatever
        the start.

        Args:
            stated_centre: (3,) [m], phantom frame.
            start: frame to begin from; the block at rest by default.
            time: of the frame [s].
        """
        centre, start = stated_centre + self._offset, self.free if start is None else start
        tool = ToolSphere(centre, self.setup.tool.radius)
        slip = self.slip
        self.budget.begin_frame(self.is_clear(replace(tool, centre=centre - np.append(slip, 0.0))))
        try:
            if not self.budget.given_up:
                return self._step(centre, start, time)
        except WorkSpentError:
            self._model, self._mesh, self.slip = None, None, slip
        finally:
            self.budget.end_frame()
        return replace(start, tool=tool, path=(), outcome=Outcome.GIVEN_UP, residual=np.inf)

    def _step(self, centre: FloatArray, start: Equilibrium, time: float | None) -> Equilibrium:
        """Solve as `step` does, with the tool, or the fixed end of its spring, at `centre`."""
        self.dense = start.dense and start.in_contact
        if self.material_history is not None:
            self.material_history.begin(time)
        slip, frame = self.slip, self._solve_compliant(centre, start)
        if frame.outcome is not Outcome.CONVERGED and self.setup.tool.compliance_times_stiffness:
            # In some of several solves the tool may have slipped in between the contact points. And
            # where one grid is replaced by another with another stiffness, a tool on a spring may
            # find no balance on either.
            self.slip, self.dense = slip, True
            self._mesh = frame.mesh if frame.outcome is Outcome.TOOL_SWINGS else None
            frame = self._solve_compliant(centre, start)
            self._mesh = None
        if frame.outcome is not Outcome.CONVERGED:
            self.slip = slip
        if self.material_history is not None:
            self.material_history.end(frame)
        return frame

    def solve_from_any(
        self, centre: FloatArray, starts: Iterable[Equilibrium | None], time: float | None = None
    ) -> Equilibrium:
        """Solve as `step` does, from the first of these frames that leads to an equilibrium, or
        from rest.

        If none does, the last attempt is returned. A long jump may lead through the block; from
        rest the tool comes in from outside. With friction a start from rest would lose its history,
        and is not tried.
        """
        rest = () if self.setup.tool.friction_coefficient else (None,)
        for start in dict.fromkeys((*starts, *rest)):
            frame = self.step(centre, start, time)
            if frame.outcome is Outcome.CONVERGED:
                break
        return frame

    def _solve_compliant(self, centre: FloatArray, start: Equilibrium) -> Equilibrium:
        """Solve with the tool, or the fixed end of its spring, at `centre` (3,) [m]."""
        if self.setup.tool.compliance_times_stiffness:
            return solve_compliant_tool(
                centre, start, self.setup, self.tolerance, self._solve_placed
            )
        return self._solve_placed(centre, start)

    def _solve_placed(self, centre: FloatArray, start: Equilibrium) -> Equilibrium:
        """Solve with the tool's centre fixed here (3,) [m]; the base slips if friction cannot hold
        it.
        """
        tool = ToolSphere(centre, self.setup.tool.radius)
        frame, friction = self._advance(tool, start), self.setup.support.friction_coefficient
        return frame if friction is None else self._slide(tool, frame, friction)

    def _slide(self, tool: ToolSphere, frame: Equilibrium, friction: float) -> Equilibrium:
        """Move the base until Coulomb friction holds it under the weight and the push."""
        weight, path = weight_of(self.setup), [frame]
        for _ in range(_MOST_SLIDES):
            step = slip_step(path[-1], friction, weight)
            if step is None or path[-1].outcome is not Outcome.CONVERGED:
                break
            self.slip = self.slip + step
            path.append(self.solve_with_fixed_base(tool, path[-1]))
        else:
            path[-1] = replace(path[-1], outcome=Outcome.BASE_SLIDES)
        return self._with_path([*frame.path, replace(frame, path=()), *path[1:]][:-1], path[-1])


def rest(setup: Setup, grid: Meshing) -> Equilibrium:
    """The block without the tool."""
    return Replay(setup, grid).free


@on_one_thread
def replay(
    setup: Setup,
    centres: FloatArray,
    grid: Meshing,
    *,
    times: ArrayLike | None = None,
    since: ReplayState | None = None,
    starts: Sequence[Equilibrium] | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
    report: Report = silent,
) -> list[Equilibrium]:
    """Solve for one equilibrium per frame.

    A frame without equilibrium is returned with its outcome, never raised: look at `outcome`, or
    call `require_converged`. A push that takes more work than its budget
    (`palpate.replay.work_budget`) is given up: its remaining frames have the outcome GIVEN_UP, and
    the replay goes on when the tool is clear of the block.

    Args:
        setup: the experiment as assumed.
        centres: (f, 3) stated tool centres [m], phantom frame, in the order of time.
        grid: the mesh.
        times: (f,) of the frames [s], required by a material with history.
        since: state at the end of an earlier replay (`Replay.state`) to continue from; rest by
            default.
        starts: equilibria of a similar setup at the same frames to begin from; the frame before by
            default.
        tolerance: relative residual at which a frame counts as converged.
        report: progress.
    """
    if starts is not None and setup.has_history:
        raise SolveError(
            "a setup whose frames depend on those before them is replayed in order of time, "
            "without starts"
        )
    block, frames, began = Replay(setup, grid, tolerance), list[Equilibrium](), monotonic()
    previous = None if since is None else since.frame
    if since is not None:
        block.resume(since)
    instants = [None] * len(centres) if times is None else np.asarray(times, dtype=float).tolist()
    if len(instants) != len(centres):
        raise SetupError(
            f"{len(instants)} times for {len(centres)} frames; give one for each", key="times"
        )
    for number, (centre, time) in enumerate(
        zip(np.asarray(centres, dtype=float), instants, strict=True)
    ):
        report(number / len(centres), _progress(number, len(centres), monotonic() - began))
        start = starts[number] if starts is not None and starts[number].in_contact else previous
        frame = block.solve_from_any(centre, (start, previous), time)
        frames.append(frame)
        previous = (
            frame if frame.outcome is Outcome.CONVERGED else previous if setup.has_history else None
        )
    return frames


def _progress(number: int, count: int, seconds: float) -> str:
    """Return what a replay is doing, with the time that is left once it can be told.

    Args:
        number: of frames that are done.
        count: of all frames.
        seconds: since the replay began.
    """
    text = f"frame {number + 1} of {count}"
    if seconds < _TELLING or not number:
        return text
    left = seconds / number * (count - number)
    return f"{text}, about " + (f"{left / 60:.0f} min" if left > 90 else f"{left:.0f} s") + " left"
