"""Replay many setups frame by frame, all solves of a frame together on one device."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from core.batch.blocks import Blocks, Frame, balls_of, blocks_of, frame_of
from core.batch.member import Begin, Member
from core.batch.membership import obstacle
from core.batch.newton import Balance
from core.batch.path import lead
from core.equilibrium import Equilibrium
from core.errors import SetupError
from core.fem.model import BlockModel
from core.fem.newton import RELATIVE_TOLERANCE, Outcome, Solution, verdict
from core.frames import FloatArray
from core.mesh import GridSpec
from core.progress import Report, part, silent
from core.replay import replay
from core.setup import Setup

__all__ = ["replay_batch"]


def replay_batch(
    setups: Sequence[Setup],
    centres: FloatArray,
    grid: GridSpec,
    *,
    device: str = "cpu",
    dtype: torch.dtype = torch.float64,
    tolerance: float = RELATIVE_TOLERANCE,
    memory: float | None = None,
    report: Report = silent,
) -> list[list[Equilibrium]]:
    """As `core.replay.replay` of each setup, in the same order.

    Args:
        setups: what is believed; they may differ in anything. One with what a batch cannot hold is replayed by itself.
        centres: (f, 3) stated tool centres [m], phantom frame, in the order of time, or (len(setups), f, 3) of each setup.
        grid: the mesh. device: of torch, such as "cpu" or "cuda".
        dtype: of the tangents and their factors; what is solved is in double precision whatever this is.
        tolerance: residual at which a frame counts as converged, over the push.
        memory: that a batch may take on the device [bytes]; half of what is free when left out.
        report: progress.

    A frame that finds no equilibrium in the batch is tried again by itself, and returned with its outcome when that fails too.
    """
    place = _device(device)
    ways = np.broadcast_to(np.asarray(centres, dtype=float), (len(setups), *np.shape(centres)[-2:]))
    together = [number for number, setup in enumerate(setups) if obstacle(setup) is None]
    groups = [[number] for number in range(len(setups)) if number not in together]
    if together:
        frame = frame_of(Member(setups[together[0]], grid, tolerance).sag().model, place)
        room = _free_memory(place) / 2 if memory is None else memory
        most = max(1, int(room / frame.layout.size(dtype)))
        groups = [together[first : first + most] for first in range(0, len(together), most)] + groups
    found: dict[int, list[Equilibrium]] = {}
    for numbers in groups:
        told = part(report, len(found) / len(setups), (len(found) + len(numbers)) / len(setups))
        if numbers[0] in together:
            batch = _Batch([Member(setups[number], grid, tolerance) for number in numbers], frame, tolerance, dtype)
            found.update(zip(numbers, batch.replay(ways[numbers], told), strict=True))
        else:
            found[numbers[0]] = replay(setups[numbers[0]], ways[numbers[0]], grid, tolerance=tolerance, report=told)
    return [found[number] for number in range(len(setups))]


def _device(name: str) -> torch.device:
    """The device of this name, if there is one here."""
    here = ["cpu", *(f"cuda:{index}" for index in range(torch.cuda.device_count()))]
    wanted = f"{name}:0" if name == "cuda" else name
    if wanted not in here:
        raise SetupError(f"there is no device {name!r} here; there is {', '.join(here)}", key="device", value=name)
    return torch.device(wanted)


def _free_memory(place: torch.device) -> float:
    """What a batch may think of as free [bytes]; more on a processor would not make it faster."""
    return float(torch.cuda.mem_get_info(place)[0]) if place.type == "cuda" else 2e9


class _Batch:
    """Some members on a frame's device."""

    def __init__(self, members: list[Member], frame: Frame, tolerance: float, dtype: torch.dtype) -> None:
        self._members, self._frame, self._tolerance, self._dtype = members, frame, tolerance, dtype
        self._place = frame.free.device
        self._models: list[BlockModel] = []
        self._blocks: Blocks | None = None

    def replay(self, ways: FloatArray, report: Report) -> list[list[Equilibrium]]:
        """All frames of all members, whose tools go along ways (b, f, 3) [m]."""
        for number in range(ways.shape[1]):
            report(number / ways.shape[1], f"frame {number + 1} of {ways.shape[1]}, {len(self._members)} sets")
            if not number:
                self._rest()
            self._step(ways[:, number])
        return [member.frames for member in self._members]

    def _rest(self) -> None:
        """Lay the blocks down under their own weight."""
        heavy = [member for member in self._members if member.weighs]
        begins = [member.sag() for member in heavy]
        for member, begin, solution in zip(heavy, begins, self._solve(begins), strict=True):
            member.rested(begin, solution)

    def _step(self, centres: FloatArray) -> None:
        """The next frame of all members, their tools stated at (b, 3) [m]."""
        begins = [member.begin(centre) for member, centre in zip(self._members, centres, strict=True)]
        touching = [number for number, begin in enumerate(begins) if begin is not None]
        solutions = dict(zip(touching, self._solve([begin for begin in begins if begin is not None]), strict=True))
        for number, (member, begin) in enumerate(zip(self._members, begins, strict=True)):
            if begin is None or not member.take(begin, solutions[number]):
                member.alone(centres[number])

    def _solve(self, begins: list[Begin]) -> list[Solution]:
        """Solutions of all that is to be solved."""
        if not begins:
            return []
        blocks, balls = self._stacked([begin.model for begin in begins]), balls_of([begin.probe for begin in begins], self._place)
        starts = [
            torch.as_tensor(np.stack([getattr(begin, name) for begin in begins]), device=self._place)
            for name in ("positions", "further")
        ]
        values = [blocks.energy(start, balls) for start in starts]
        start = torch.where((values[1] < values[0])[:, None, None], starts[1], starts[0])
        before = balls_of([begin.before for begin in begins], self._place).centres
        found = lead(blocks, start, before, balls, self._tolerance, self._dtype)
        return _solutions(begins, found)

    def _stacked(self, models: list[BlockModel]) -> Blocks:
        """The models as tensors; the last ones are kept."""
        same = len(models) == len(self._models) and all(new is old for new, old in zip(models, self._models, strict=True))
        if self._blocks is None or not same:
            self._models, self._blocks = models, blocks_of(models, self._frame)
        return self._blocks


def _solutions(begins: list[Begin], found: Balance) -> list[Solution]:
    """As `core.fem.newton` states them."""
    positions, push, balanced = (tensor.cpu().numpy() for tensor in (found.positions, found.push, found.balanced))
    numbers = zip(found.iterations.tolist(), found.misfit.tolist(), found.penetration.tolist(), strict=True)
    return [
        Solution(
            positions[i], push[i], verdict(begin.model, begin.probe, positions[i]) if balanced[i] else Outcome.ITERATIONS, *number
        )
        for i, (begin, number) in enumerate(zip(begins, numbers, strict=True))
    ]
