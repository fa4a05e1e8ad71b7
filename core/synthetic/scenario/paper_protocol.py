"""The protocol of Wu, Kazanzides and Unberath (2020) on the virtual bench: twelve sequences of one
gelatin block, 14 minutes.

As in the paper the block measures 68.7 x 39.3 x 35.8 mm, the tool is a sphere on a shaft, one
sequence of two minutes validates, and test sequences are never trained on. Unlike in the paper, two
of the three test sequences are of kinds of motion that are trained on (pushes from above and into a
side), and one is of a kind that is not (drags along the top). Three effects are hidden at once: the
tool's true radius, the block's weight, and a base that slides.

The bench solves each push at key frames about a millimetre apart along the tool's path, on
quadratic elements that are fine at the contact and with another law than the replay's. Between them
the surface follows monotone cubics in the arc length (`PathSegment`). Every cloud is then cast from
the surface at its own instant, with its own noise, missing points and stray points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario

__all__ = ["PAPER_EFFECTS", "PAPER_SEED", "PAPER_SIZES", "PaperSize", "paper_scenario"]

PaperSize = Literal["short", "medium", "full"]
PAPER_SEED = 2020
"""Seed of these datasets, so that there is one of each size."""

PAPER_EFFECTS = (
    HiddenEffect("tool_radius", {"radius": 0.0065}),
    HiddenEffect("gravity", {"specific_weight_over_stiffness": 2.2}),
    HiddenEffect("base_slip", {"friction_coefficient": 0.12}),
)
"""Hidden effects: a sphere of 6.5 mm stated as 5 mm, the weight of a gel of 5 kPa, and a base on a
wet table."""


@dataclass(frozen=True, kw_only=True)
class _Plan:
    """Number and length of the sequences, and sampling of the camera.

    Attributes:
        train: number of training sequences by kind.
        test: number of test sequences by kind.
        rounds: number of rounds by kind.
        validation: number of rounds of the validation sequence.
        rate: clouds per second [1/s].
        density: approximate number of points on the block in one cloud.
        fine: longest edge at the contact [m].
    """

    train: Mapping[str, int]
    test: Mapping[str, int]
    rounds: Mapping[str, int]
    validation: int
    rate: float
    density: int = 2600
    fine: float = 2.6e-3


PAPER_SIZES: Mapping[PaperSize, _Plan] = {
    "short": _Plan(
        train={"poke-top": 2, "poke-side": 1},
        test={"poke-top": 1, "poke-side": 1, "drag": 1},
        rounds={"poke-top": 1, "poke-side": 1, "drag": 2},
        validation=1,
        rate=6.0,
        density=1500,
        fine=3.4e-3,
    ),
    "medium": _Plan(
        train={"poke-top": 5, "poke-side": 3},
        test={"poke-top": 1, "poke-side": 1, "drag": 1},
        rounds={"poke-top": 1, "poke-side": 1, "drag": 3},
        validation=2,
        rate=10.0,
    ),
    "full": _Plan(
        train={"poke-top": 5, "poke-side": 3},
        test={"poke-top": 1, "poke-side": 1, "drag": 1},
        rounds={"poke-top": 5, "poke-side": 4, "drag": 7},
        validation=9,
        rate=30.0,
    ),
}
"""`full` is the paper's: 14 minutes at 30 Hz. `medium` has the same twelve sequences with fewer
touches, `short` seven of them."""


def paper_scenario(
    size: PaperSize = "full", effects: tuple[HiddenEffect, ...] = PAPER_EFFECTS
) -> Scenario:
    """The protocol in one of its sizes, with these effects hidden."""
    plan = PAPER_SIZES[size]
    counts = dict.fromkeys(plan.rounds, 0)

    def names(numbers: Mapping[str, int]) -> tuple[str, ...]:
        result = []
        for kind, count in numbers.items():
            for _ in range(count):
                counts[kind] += 1
                result.append(f"{kind}-{counts[kind]:02d}")
        return tuple(result)

    splits = {
        "train": names(plan.train),
        "validation": names({"poke-top": 1}),
        "test": names(plan.test),
    }
    sequences = tuple(name for group in splits.values() for name in group)
    rounds = {name: plan.rounds[name.rpartition("-")[0]] for name in sequences} | {
        splits["validation"][0]: plan.validation
    }
    return Scenario(
        effects=effects,
        sequences=sequences,
        rounds=rounds,
        splits=splits,
        rate=plan.rate,
        density=plan.density,
        fine=plan.fine,
        robot_rate=1000.0 if size == "full" else 200.0,
    )
