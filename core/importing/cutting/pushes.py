"""Sequences cut out of recordings: pushes found by the contacts of the tool, idle ends trimmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from palpate.dataset.tool_motion import Contact, averaged_path, find_contacts
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.importing.rules import CutRules, SequenceWindow
from palpate.importing.timed_recording import TimedRecording
from palpate.setup.setup import Box, Shape

__all__ = ["LocatedPhantom", "find_pushes", "whole_recording"]

SHALLOW = 0.0005
"""Depth below which a contact is a touch or a trace [m], about the accuracy of touches."""
AT_TOUCH = 0.001
"""Distance to a touched place within which the tool is at it [m], about the accuracy of touches."""
JOINED = 0.5
"""Pause between two contacts of one push [s]: the ball skids, or noise lifts it."""
MOVING = 0.002
"""Speed above which the tool moves [m/s]."""
_PREFIX = {"top": "poke-top", "side": "poke-side", "drag": "drag", "trace": "trace", "": "push"}


@dataclass(frozen=True, eq=False)
class LocatedPhantom:
    """The stated phantom and tool as the robot finds them.

    Attributes:
        geometry: of the phantom.
        radius: of the ball [m].
        phantom_from_robot: from touches, traces or a stated pose.
        touched: (n, 3) tool centres at the touches of landmarks [m], robot frame.
        landmarks: (n) their names.
    """

    geometry: Box | Shape
    radius: float
    phantom_from_robot: Transform
    touched: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    landmarks: tuple[str, ...] = ()

    def contacts(self, recording: TimedRecording) -> tuple[tuple[Contact, ...], FloatArray]:
        """Contacts of a recording, and the gaps (n,) [m] at `averaged_path`'s times."""
        time, path = averaged_path(recording.time, self.in_phantom(recording))
        return find_contacts(self.geometry, self.radius, time, path)

    def is_touch(self, recording: TimedRecording, push: Contact) -> bool:
        """Whether a contact comes to a touched place without travelling along the surface."""
        if push.kind == "drag" or not len(self.touched):
            return False
        time = recording.time
        path = recording.positions[(time >= push.start) & (time <= push.end)]
        apart = np.linalg.norm(path[:, None] - self.touched, axis=2)
        return bool(len(path) and apart.min() < AT_TOUCH)

    def in_phantom(self, recording: TimedRecording) -> FloatArray:
        """Tool centres (n, 3) [m], phantom frame."""
        return self.phantom_from_robot.apply(recording.positions)


def find_pushes(
    recordings: Sequence[TimedRecording], phantom: LocatedPhantom, rules: CutRules
) -> tuple[SequenceWindow, ...]:
    """Cut recordings into pushes and strokes; the parts between two of them are shared evenly.

    Dwells at the surface, such as touches of landmarks, are no pushes.
    """
    windows: list[SequenceWindow] = []
    counts: dict[str, int] = {}
    for recording in recordings:
        time = recording.time
        pushes = [
            (push, "" if phantom.is_touch(recording, push) else kind)
            for push, kind in _joined(phantom.contacts(recording)[0])
        ]
        for at, (push, kind) in enumerate(pushes):
            if not kind:
                continue
            before = pushes[at - 1][0].end if at else float(time[0])
            after = pushes[at + 1][0].start if at + 1 < len(pushes) else float(time[-1])
            start = max(push.start - rules.lead, (before + push.start) / 2 if at else before)
            end = min(push.end + rules.tail, _middle(push.end, after, at + 1 < len(pushes)))
            counts[kind] = counts.get(kind, 0) + 1
            windows.append(
                SequenceWindow.model_validate(
                    {
                        "name": f"{_PREFIX[kind]}-{counts[kind]:02d}",
                        "recording": recording.name,
                        "start": round(start, 4),
                        "end": round(end, 4),
                        "kind": kind,
                    }
                )
            )
    return tuple(windows)


def whole_recording(recording: TimedRecording, rules: CutRules) -> SequenceWindow:
    """One sequence of a whole recording; its idle ends are cut off but for the lead."""
    time = recording.time
    start, end = float(time[0]), float(time[-1])
    if rules.trim:
        steady, path = averaged_path(time, recording.positions)
        if len(steady) > 2:
            speed = np.linalg.norm(np.gradient(path, axis=0), axis=1) / np.gradient(steady)
            moving = steady[speed > MOVING]
            if len(moving):
                start = max(start, float(moving[0]) - rules.lead)
                # After a release the surface may still creep: that is no idle end.
                end = min(end, float(moving[-1]) + max(rules.tail, 10.0))
    return SequenceWindow(
        name=recording.name,
        recording=recording.name,
        start=np.floor(start * 1e4) / 1e4,
        end=np.ceil(end * 1e4) / 1e4,
    )


def _joined(contacts: Sequence[Contact]) -> list[tuple[Contact, str]]:
    """Contacts with their kinds; those apart by a short pause become one, of the deepest's kind."""
    joined: list[tuple[Contact, list[Contact]]] = []
    for one in contacts:
        if joined and one.start - joined[-1][1][-1].end < JOINED:
            joined[-1][1].append(one)
        else:
            joined.append((one, [one]))
    found = []
    for _, parts in joined:
        deepest = max(parts, key=lambda one: one.depth)
        whole = Contact(
            kind=deepest.kind,
            start=parts[0].start,
            end=parts[-1].end,
            depth=deepest.depth,
            place=parts[0].place,
            travel=max(one.travel for one in parts),
            speed=deepest.speed,
        )
        found.append((whole, _kind(whole)))
    return found


def _kind(push: Contact) -> str:
    """Kind of a push; empty for a touch."""
    if push.depth >= SHALLOW:
        return push.kind
    return "trace" if push.kind == "drag" else ""


def _middle(end: float, after: float, is_push: bool) -> float:
    return (end + after) / 2 if is_push else after
