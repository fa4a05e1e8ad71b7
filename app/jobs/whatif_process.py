"""What-if over the wire: single frames of runs solved again, and a tool led by hand."""

from __future__ import annotations

import json
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from palpate.app.jobs.warm_process import WarmProcess
from palpate.app.storage.run_store import Run
from palpate.foundation.errors import RunError

if TYPE_CHECKING:
    from palpate.recording.interactive import InteractiveFrame, InteractiveReplay
    from palpate.recording.resolve_frame import ResolvedFrame

__all__ = ["FrameSolver", "InteractiveSession", "InteractiveSolver"]

MOST_HANDS = 8
"""Blocks under hands that a process keeps; the one longest untouched goes first, and begins anew
when touched again."""


class FrameSolver(WarmProcess):
    """Solves frames of runs again, one at a time, in a process of its own."""

    def beginnings(self, run: Run, sequence: str) -> list[dict[str, Any]]:
        """A finite size of each effect, from which to go on by hand."""
        return self.ask(_beginnings, *_key(run, sequence))

    def solve(
        self, run: Run, sequence: str, frame: int, effects: list[dict[str, Any]], tuned: bool
    ) -> ResolvedFrame:
        """The frame with these effects; RunError where the solve takes too long or its process
        ends.
        """
        return self.ask(_solve, *_key(run, sequence), frame, effects, tuned)


@dataclass(frozen=True)
class InteractiveSession:
    """One who leads the tool: `name` tells hands apart, whose blocks each remember their own way;
    `key` says of which sequence.
    """

    name: str
    key: tuple[str, str, tuple[int, ...], str]
    effects: list[dict[str, Any]]
    tuned: bool

    @classmethod
    def of(
        cls, name: str, run: Run, sequence: str, effects: list[dict[str, Any]], tuned: bool
    ) -> Self:
        """Of a run's sequence; RunError where it does not say where its data are."""
        return cls(name, _key(run, sequence), effects, tuned)


class InteractiveSolver(WarmProcess):
    """Blocks under tools that hands lead, all in one process of their own."""

    def at(
        self, hand: InteractiveSession, centre: tuple[float, float, float], within: bool = False
    ) -> InteractiveFrame:
        """What the block answers with the tool there [m]; RunError where it takes too long or the
        process ends.
        """
        return self.ask(_felt, hand, centre, within)


def _key(run: Run, sequence: str) -> tuple[str, str, tuple[int, ...], str]:
    folder = run.origin.get("dataset")
    if folder is None:
        raise RunError(
            f"run {run.name} does not say where its dataset is; make the run again", run=run.name
        )
    if "setup" not in run.model:
        raise RunError(
            f"run {run.name}: model.json states no setup; make the run again",
            run=run.name,
            file="model.json",
        )
    clouds = tuple(int(index) for index in run.replay(sequence)["cloud_index"])
    return str(folder), sequence, clouds, json.dumps(run.model)


def _beginnings(
    folder: str, sequence: str, clouds: tuple[int, ...], model: str
) -> list[dict[str, Any]]:
    from palpate.recording.resolve_frame import open_resolver

    return open_resolver(folder, sequence, clouds, model).beginnings()


def _solve(
    folder: str,
    sequence: str,
    clouds: tuple[int, ...],
    model: str,
    frame: int,
    effects: list[dict[str, Any]],
    tuned: bool,
) -> ResolvedFrame:
    from palpate.recording.resolve_frame import open_resolver
    from palpate.recording.saved_model import effects_from

    return open_resolver(folder, sequence, clouds, model).solve(frame, effects_from(effects), tuned)


_hands: OrderedDict[str, InteractiveReplay] = OrderedDict()


def _felt(
    hand: InteractiveSession, centre: tuple[float, float, float], within: bool
) -> InteractiveFrame:
    import numpy as np

    from palpate.recording.resolve_frame import open_resolver
    from palpate.recording.saved_model import effects_from

    key = json.dumps([hand.name, hand.key, hand.effects, hand.tuned])
    live = _hands.pop(key, None)
    if live is None:
        live = open_resolver(*hand.key).live(effects_from(hand.effects), hand.tuned)
    _hands[key] = live
    while len(_hands) > MOST_HANDS:
        _hands.popitem(last=False)
    return live.at(np.array(centre), within=within)
