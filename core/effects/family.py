"""Families of effects that act in one way, by laws that data may not tell apart.

Where the best effect leaves more than noise, its law is not the true one. The difference of gains
between two laws of one family that are both wrong then says little about the cause.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BASE", "CAMERA", "MEMORY", "STIFFNESS", "TOOL", "Family"]


@dataclass(frozen=True)
class Family:
    """One family of effects.

    Attributes:
        name: of the family.
        sure: what is sure where a member is found, as a sentence without a full stop.
        parted_by: frames or motions that tell the members apart, as a noun phrase.
    """

    name: str
    sure: str
    parted_by: str


MEMORY = Family(
    "memory",
    "the material remembers what was done to it",
    "frames in the ten seconds after a release, and the first push of the next sequence",
)
TOOL = Family(
    "tool",
    "the tool presses deeper or less deep than stated",
    "pushes from another side, and a measurement of the ball",
)
CAMERA = Family(
    "camera",
    "the camera does not see where it should",
    "a rest cloud before and after each sequence",
)
STIFFNESS = Family(
    "stiffness",
    "the material is not as stiff everywhere, or at every strain, as stated",
    "pushes at other places and to other depths",
)
BASE = Family("base", "the base gives way", "pushes into the sides, close to the base")
