"""Kinds of motion (top, side, drag) of sequences and of their pushes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from palpate.dataset import Dataset
from palpate.dataset.tool_motion import ContactKind, describe_motion
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.setup.setup import Setup

__all__ = ["kinds_in", "kinds_of_pushes"]


def kinds_in(dataset: Dataset, names: Iterable[str], setup: Setup) -> set[ContactKind]:
    """Return the kinds of motion in these sequences."""
    motions = (
        describe_motion(dataset, dataset.sequence(name), setup.phantom_from_robot) for name in names
    )
    return {contact.kind for motion in motions for contact in motion.contacts}


def kinds_of_pushes(
    dataset: Dataset, data: Sequence[Observations], setup: Setup
) -> dict[str, ContactKind]:
    """Return the kind of each push by "sequence/number".

    It is the kind of the contact nearest in time: a push may begin before the tool touches.
    """
    kinds: dict[str, ContactKind] = {}
    for item in data:
        contacts = describe_motion(
            dataset, dataset.sequence(item.name), setup.phantom_from_robot
        ).contacts
        if not contacts:
            continue
        middles = np.array([(contact.start + contact.end) / 2 for contact in contacts])
        for probe in sorted({group.push for group in item.groups if not group.free}):
            frames = [
                frame
                for group in item.groups
                if group.push == probe and not group.free
                for frame in group.frames
            ]
            nearest = int(np.abs(middles - item.times[frames].mean()).argmin())
            kinds[f"{item.name}/{probe}"] = contacts[nearest].kind
    return kinds
