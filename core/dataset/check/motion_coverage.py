"""Missing motions and measurements of a dataset, with the effects that they would show."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from palpate.dataset.tool_motion import ContactKind, ToolMotion

__all__ = ["CoverageGap", "coverage_gaps"]

FEW_UNTOUCHED = 3
"""Least number of untouched clouds, which show the noise."""
LONG_REST = 2.0
"""Long rest after a release [s], several time constants of the quicker soft materials."""
OTHER_DEPTH = 1.25
"""Ratio from which two depths differ [1]."""
OTHER_SPEED = 2.0
"""Ratio from which two speeds differ [1]."""
OTHER_PLACE = 0.010
"""Distance from which two places differ [m]."""
FEW_PUSHES = 12
"""Least number of pushes without clouds; fewer leave most of a phantom untouched."""
SHALLOW = 0.002
"""Depth below which a push is shallow [m], half of what a hand presses."""


@dataclass(frozen=True)
class CoverageGap:
    """A missing motion or measurement.

    Attributes:
        effects: names of the effects that it would show.
        sentence: for a person.
    """

    effects: tuple[str, ...]
    sentence: str


def coverage_gaps(
    motions: dict[str, ToolMotion], observed: bool, forces: bool
) -> tuple[CoverageGap, ...]:
    """List what is missing.

    Args:
        motions: by sequence.
        observed: whether there are clouds.
        forces: whether there are forces.
    """
    gaps = [*_of_measurements(observed, forces)]
    if motions and observed:
        gaps += [
            *_of_kinds(list(motions.values())),
            *_of_variety(list(motions.values())),
            *_of_rests(motions),
        ]
    elif motions:
        gaps += _of_palpation(list(motions.values()))
    return tuple(gaps)


def _of_measurements(observed: bool, forces: bool) -> Iterable[CoverageGap]:
    if not observed:
        yield CoverageGap(
            ("base_slip", "camera_registration", "time_offset"),
            "no clouds: the surface is not seen, only forces are compared; what the camera alone "
            "would show is not weighed",
        )
    if not forces:
        yield CoverageGap(
            ("young_modulus",),
            "no forces: the stiffness of a homogeneous phantom does not show; add forces.csv",
        )


def _of_kinds(motions: list[ToolMotion]) -> Iterable[CoverageGap]:
    needed: dict[ContactKind, tuple[str, tuple[str, ...]]] = {
        "top": ("poke from above", ("stiff_inclusion", "tool_radius", "poisson_ratio")),
        "side": ("push from the side", ("base_slip", "base_detachment")),
        "drag": ("drag along the surface", ("tool_friction", "time_offset")),
    }
    for kind, (name, effects) in needed.items():
        count = sum(motion.has(kind) for motion in motions)
        if count == 0:
            yield CoverageGap(effects, f"no {name}: add two, elsewhere each")
        elif count == 1:
            yield CoverageGap(
                effects,
                f"only one sequence with a {name}: repeat it elsewhere, so that one can be kept "
                "for the test",
            )


def _of_palpation(motions: list[ToolMotion]) -> Iterable[CoverageGap]:
    """Gaps of a palpation without clouds."""
    pushes = [contact for motion in motions for contact in motion.contacts]
    if len(pushes) < FEW_PUSHES:
        text = (
            f"{len(pushes)} pushes in all: a lump between them is not felt, add more, none "
            f"over {1e3 * OTHER_PLACE:.0f} mm away"
        )
        yield CoverageGap(("stiff_inclusion",), text)
    shallow = [contact for contact in pushes if contact.depth < SHALLOW]
    if pushes and len(shallow) > len(pushes) / 2:
        text = (
            f"{len(shallow)} of {len(pushes)} pushes are less than {1e3 * SHALLOW:.0f} mm "
            "deep: deeper ones reach farther"
        )
        yield CoverageGap(("stiff_inclusion", "young_modulus"), text)


def _of_variety(motions: list[ToolMotion]) -> Iterable[CoverageGap]:
    pushes = [
        contact for motion in motions for contact in motion.contacts if contact.kind != "drag"
    ]
    if len(pushes) < 2:
        return
    depths, speeds = ([getattr(motion, name) for motion in pushes] for name in ("depth", "speed"))
    if max(depths) < OTHER_DEPTH * max(min(depths), 1e-6):
        text = (
            f"all pushes are about {1e3 * max(depths):.1f} mm deep: add a clearly shallower "
            "and a deeper one"
        )
        yield CoverageGap(
            ("tool_radius", "tool_offset", "surface_layer", "strain_stiffening"), text
        )
    if max(speeds) < OTHER_SPEED * max(min(speeds), 1e-6):
        text = f"all pushes go at about {1e3 * max(speeds):.1f} mm/s: add a slow and a fast one"
        yield CoverageGap(("time_offset", "viscoelasticity"), text)
    apart = max(
        float(np.linalg.norm(np.subtract(one.place, other.place)))
        for one, other in combinations(pushes, 2)
    )
    if apart < OTHER_PLACE:
        text = (
            f"all pushes lie within {1e3 * apart:.1f} mm: add one more than "
            f"{1e3 * OTHER_PLACE:.0f} mm away"
        )
        yield CoverageGap(("stiff_inclusion", "stiffness_gradient", "anisotropy"), text)


def _of_rests(motions: dict[str, ToolMotion]) -> Iterable[CoverageGap]:
    touching = {name: motion for name, motion in motions.items() if motion.contacts}
    if early := [
        name for name, motion in touching.items() if motion.untouched_before < FEW_UNTOUCHED
    ]:
        text = (
            f"fewer than {FEW_UNTOUCHED} untouched clouds before the first contact in "
            f"{', '.join(early)}: start recording earlier"
        )
        yield CoverageGap(("camera_registration", "time_offset"), text)
    longest = max((motion.rest_after for motion in touching.values()), default=LONG_REST)
    if longest < LONG_REST:
        text = (
            f"after release the longest rest is {longest:.1f} s: record a few time constants, "
            f"at least {LONG_REST:.0f} s"
        )
        yield CoverageGap(("viscoelasticity", "permanent_set"), text)
