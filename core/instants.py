"""The equilibria that a replay went through, in order, as what goes back through them needs them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.equilibrium import Equilibrium
from core.fem.model import Probe
from core.fem.newton import Outcome
from core.frames import FloatArray
from core.memory import History, Memory
from core.replay import Replay
from core.sensitivity import local_probe

__all__ = ["Instant", "instants_of", "tool_shifts"]


@dataclass(frozen=True, eq=False)
class Instant:
    """An equilibrium on the way: the rest, then frames, each after those on the way to it (`Equilibrium.way`).

    Attributes:
        frame: the equilibrium. number: of the frame that it is, or is on the way to; None for the rest.
        place, places: which of the equilibria to that frame it is, from 1, and how many there are.
        time: of the frame [s]; None for the rest. past: what was remembered before the frame; None without memory.
    """

    frame: Equilibrium
    number: int | None
    place: int
    places: int
    time: float | None
    past: History | None

    @property
    def last(self) -> bool:
        """Whether it is a frame (or the rest), not only on the way to one."""
        return self.place == self.places


def instants_of(
    block: Replay, memory: Memory | None, frames: Sequence[Equilibrium], times: Sequence[float] | None
) -> list[Instant]:
    """The rest and all that led to frames that are equilibria; what is none is not remembered.

    `memory` is one as before the first frame, and is left as after the last.
    """
    found = [Instant(block.free, None, 1, 1, None, None if memory is None else memory.history)]
    if memory is not None:
        memory.start(block.free)
    for number, frame in enumerate(frames):
        if frame.outcome is not Outcome.CONVERGED:
            continue
        time, past = None if times is None else times[number], None if memory is None else memory.history
        chain = (*frame.way, frame)
        found += [Instant(each, number, place + 1, len(chain), time, past) for place, each in enumerate(chain)]
        if memory is not None:
            memory.begin(time)
            memory.end(frame)
    return found


def _moved(probe: Probe, shift: FloatArray, growth: float) -> Probe:
    return Probe(probe.centre + shift, probe.radius + growth)


def _begins(block: Replay, start: Equilibrium, probe: Probe, shifts: tuple[FloatArray, FloatArray], growth: float) -> FloatArray:
    """How far the place shifts (3,) [m] where the way from a frame to `probe` begins, when both ends shift and the tool grows."""
    moved = replace(start, probe=_moved(start.probe, shifts[0], growth))
    ahead, here = block.from_where(moved, _moved(probe, shifts[1], growth)), block.from_where(start, probe)
    return np.asarray(ahead.centre - here.centre)


def tool_shifts(block: Replay, instants: Sequence[Instant], moves: FloatArray, growth: float) -> tuple[FloatArray, FloatArray]:
    """How far the tool's centre shifts at each instant, and where the step to it begins, both (i, 3) [m].

    Args:
        moves: (f, 3) of the frames' centres [m]. growth: of the tool's radius [m].
    """
    here, before = np.zeros((len(instants), 3)), np.zeros((len(instants), 3))
    if not moves.any() and not growth:
        return here, before
    for index, instant in enumerate(instants):
        if instant.number is None:
            continue
        first, end = index - instant.place, index + instant.places - instant.place
        start, share = instants[first].frame, instant.place / instant.places
        shift = moves[instant.number]
        if instant.places > 1 and block.setup.tool.friction_coefficient:
            begin = _begins(block, start, local_probe(instants[end].frame), (here[first], shift), growth)
            shift = (1 - share) * begin + share * shift
        here[index] = shift
        previous = instants[index - 1].frame
        before[index] = _begins(block, previous, local_probe(instant.frame), (here[index - 1], shift), growth)
    return here, before
