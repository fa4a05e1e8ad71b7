"""Processes for what-if: single frames of runs solved again, and interactive replays."""

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

MOST_REPLAYS = 8
"""Interactive replays that the process stores; the least recently used one is dropped, and starts
again when it is requested."""


class FrameSolver(WarmProcess):
    """Solves frames of runs again, one at a time, in another process."""

    def beginnings(self, run: Run, sequence: str) -> dict[str, Any]:
        """Choices by hand: `beginnings`, an instance of each effect with a finite size;
        `impossible`, the other effects with the reason; and `spans` of numbers by effect.
        """
        self.set_up(_open, *_key(run, sequence))
        return self.ask(_beginnings, *_key(run, sequence))

    def solve(
        self, run: Run, sequence: str, frame: int, effects: list[dict[str, Any]], tuned: bool
    ) -> ResolvedFrame:
        """Solve the frame with these effects; raises RunError where this takes too long or the
        process ends.
        """
        self.set_up(_open, *_key(run, sequence))
        return self.ask(_solve, *_key(run, sequence), frame, effects, tuned)


@dataclass(frozen=True)
class InteractiveSession:
    """An interactive replay of one sequence.

    Attributes:
        name: tells sessions apart; each has a history of its own.
        key: arguments that open the sequence.
        effects: of the model, as JSON.
        tuned: whether the model has the fitted nuisance parameters.
    """

    name: str
    key: tuple[str, str, tuple[int, ...], str]
    effects: list[dict[str, Any]]
    tuned: bool

    @classmethod
    def of(
        cls, name: str, run: Run, sequence: str, effects: list[dict[str, Any]], tuned: bool
    ) -> Self:
        """Session of a run's sequence; raises RunError where the run does not name its dataset."""
        return cls(name, _key(run, sequence), effects, tuned)


class InteractiveSolver(WarmProcess):
    """Solves interactive replays, all in one process of their own."""

    def at(
        self, session: InteractiveSession, centre: tuple[float, float, float], within: bool = False
    ) -> InteractiveFrame:
        """Solve with the tool's centre there [m]; raises RunError where this takes too long or the
        process ends.
        """
        self.set_up(_open_live, session)
        return self.ask(_interactive_frame, session, centre, within)


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


def _open(folder: str, sequence: str, clouds: tuple[int, ...], model: str) -> None:
    from palpate.recording.resolve_frame import open_resolver

    open_resolver(folder, sequence, clouds, model)


def _beginnings(folder: str, sequence: str, clouds: tuple[int, ...], model: str) -> dict[str, Any]:
    from palpate.recording.resolve_frame import open_resolver

    resolver = open_resolver(folder, sequence, clouds, model)
    return {
        "beginnings": resolver.beginnings(),
        "impossible": resolver.impossible(),
        "spans": resolver.spans(),
    }


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


_replays: OrderedDict[str, InteractiveReplay] = OrderedDict()


def _open_live(session: InteractiveSession) -> None:
    """Set an interactive replay up, unless it is there, and touch nothing with its tool."""
    _live(session)


def _live(session: InteractiveSession) -> InteractiveReplay:
    from palpate.recording.resolve_frame import open_resolver
    from palpate.recording.saved_model import effects_from

    key = json.dumps([session.name, session.key, session.effects, session.tuned])
    live = _replays.pop(key, None)
    if live is None:
        live = open_resolver(*session.key).live(effects_from(session.effects), session.tuned)
    _replays[key] = live
    while len(_replays) > MOST_REPLAYS:
        _replays.popitem(last=False)
    return live


def _interactive_frame(
    session: InteractiveSession, centre: tuple[float, float, float], within: bool
) -> InteractiveFrame:
    import numpy as np

    return _live(session).at(np.array(centre), within=within)
