"""Blind cases: their kinds and mix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from palpate.foundation.errors import RunError

__all__ = [
    "ALIKE",
    "KINDS",
    "MIX",
    "SHAPED",
    "Case",
    "all_cases",
    "draw_cases",
    "with_nuisances",
    "with_shapes",
]

KINDS = ("control", "clear", "subtle", "pair", "outside", "twins", "modulus", "fault")
"""Kinds of cases: nothing hidden; one effect of clear or of subtle size; two effects; a disturbance
outside the catalogue; one effect of the family that looks alike; another Young's modulus alone,
which does not show without a measured force; a fault of the bench that effects state
(`palpate.synthetic.Nuisance.causes`). A drawn suite has no fault unless it is asked for."""

SHAPED = ("control", "clear", "pair")
"""Kinds of cases that the bench makes of shapes other than a block."""

MIX: Mapping[str, float] = {
    "control": 0.25,
    "clear": 0.30,
    "subtle": 0.15,
    "pair": 0.125,
    "outside": 0.075,
    "twins": 0.05,
    "modulus": 0.05,
    "fault": 0.0,
}
"""Shares of a drawn suite [1]: of 200 scenarios 50 hide nothing, so that a rate of one false alarm
in 50 shows."""
_ASKED = 0.05
"""Share of a kind that is drawn only where it is asked for [1]."""

ALIKE = (
    "tool_radius",
    "tool_offset",
    "tool_compliance",
    "surface_layer",
    "stiffness_gradient",
    "strain_stiffening",
)
"""Effects that look alike: each reproduces most of the others' pattern in a push from above."""

_KIND_SEEDS, _SUITE_SEEDS = 100_000, 1_000_000


@dataclass(frozen=True)
class Case:
    """One dataset to be made.

    Attributes:
        name: includes the names of what is hidden.
        seed: of everything random.
        kind: one of KINDS.
        hidden: names of the effects, of the disturbance, or of the fault.
        short: whether five sequences are recorded, not seven.
        nuisances: whether the bench has the nuisances of real ones; every second case then has 1 to
            3 mm of depth noise.
        camera: name of a camera in place of a drawn one; None for a drawn one.
        filters: names of the filters on its images; None for a drawn one.
        shape: family of the phantom's shape; None for a block.
    """

    name: str
    seed: int
    kind: str
    hidden: tuple[str, ...] = ()
    short: bool = False
    nuisances: bool = False
    camera: str | None = None
    filters: tuple[str, ...] | None = None
    shape: str | None = None

    @property
    def noisy(self) -> bool:
        """Whether the depth noise is 1 to 3 mm."""
        return self.nuisances and self.camera is None and self.seed % 2 == 1

    def to_json(self) -> dict[str, Any]:
        """Plain values; of the bench only what differs from a bench without nuisances."""
        values = asdict(self) | {"hidden": list(self.hidden)}
        if self.filters is not None:
            values["filters"] = list(self.filters)
        bench = ("nuisances", "camera", "filters", "shape")
        return {
            name: value
            for name, value in values.items()
            if name not in bench or value not in (False, None)
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Case:
        """Read the output of `to_json`."""
        lists = {name: tuple(data[name]) for name in ("hidden", "filters") if name in data}
        return cls(**{**data, **lists})


def all_cases(
    seed: int, controls: int = 10, effects: Sequence[str] | None = None, short: bool = False
) -> list[Case]:
    """Make a case of each effect and of each disturbance, and controls, each with its own seed.

    Args:
        seed: of the suite.
        controls: number of cases with nothing hidden.
        effects: names; those of `palpate.synthetic.WEIGHED`, and the disturbances, without it.
        short: whether five sequences are recorded, not seven.

    Raises:
        RunError: for an unknown effect.
    """
    from palpate.synthetic import HIDDEN, WEIGHED_DISTURBANCES

    chosen, known = _checked_effects(effects), list(HIDDEN)
    cases = [
        Case(f"{effect}-{seed}", 1000 * seed + 1 + known.index(effect), "clear", (effect,), short)
        for effect in chosen
    ]
    if effects is None:
        cases += [
            Case(f"{name}-{seed}", 1000 * seed + 401 + place, "outside", (name,), short)
            for place, name in enumerate(WEIGHED_DISTURBANCES)
        ]
    return cases + [
        Case(f"control-{seed}-{place:02d}", 1000 * seed + 500 + place, "control", (), short)
        for place in range(controls)
    ]


def draw_cases(
    seed: int,
    count: int,
    kinds: Sequence[str] | None = None,
    effects: Sequence[str] | None = None,
    controls: int | None = None,
    short: bool = False,
) -> list[Case]:
    """Draw a suite in the proportions of MIX; RunError for unknown names.

    A longer suite begins with the cases of a shorter one. Within a kind each effect (pair,
    disturbance) comes once before any comes again.

    Args:
        seed: of everything that is hidden.
        count: number of cases.
        kinds: of KINDS; all without it.
        effects: to be hidden; those of `palpate.synthetic.WEIGHED` without it.
        controls: number of cases with nothing hidden; by MIX without it.
        short: whether five sequences are recorded, not seven.
    """
    chosen = _checked_kinds(kinds)
    effects = _checked_effects(effects)
    if controls is not None and controls > count:
        raise RunError(
            f"{controls} controls are more than the {count} scenarios in all", controls=controls
        )
    drawn = [kind for kind in chosen if kind != "control"] if controls is not None else chosen
    order = [*_interleaved(drawn, count - (controls or 0)), *["control"] * (controls or 0)]
    met: dict[str, int] = {}
    cases = []
    for kind in order:
        number = met.setdefault(kind, 0)
        met[kind] += 1
        hidden = _hidden(kind, seed, number, effects)
        name = "-".join([kind, str(seed), f"{number:03d}", *hidden])
        own = _SUITE_SEEDS * seed + _KIND_SEEDS * (1 + KINDS.index(kind)) + number
        cases.append(Case(name, own, kind, hidden, short))
    return cases


def with_nuisances(
    cases: Sequence[Case], camera: str | None = None, filters: Sequence[str] | None = None
) -> list[Case]:
    """The same cases on a bench with nuisances; RunError for an unknown camera or filter.

    Args:
        cases: on a bench without.
        camera: its name; drawn if None.
        filters: names of the filters on its images; drawn if None.
    """
    from palpate.synthetic import draw_nuisances

    draw_nuisances(0, camera=camera, filters=filters)
    chosen = None if filters is None else tuple(filters)
    return [replace(case, nuisances=True, camera=camera, filters=chosen) for case in cases]


def with_shapes(cases: Sequence[Case]) -> list[Case]:
    """The same cases with phantoms of other shapes than a block, one family after the other.

    Raises RunError for a kind of case or an effect that the bench cannot make of a shape.
    """
    from palpate.synthetic import FAMILIES, HIDDEN_IN_SHAPES

    for case in cases:
        unknown = [name for name in case.hidden if name not in HIDDEN_IN_SHAPES]
        if case.kind not in SHAPED or case.nuisances or unknown:
            what = unknown[0] if unknown else "nuisances" if case.nuisances else case.kind
            raise RunError(
                f"{case.name}: the virtual bench has no {what} on a shape; kinds are "
                f"{', '.join(SHAPED)}, and effects {', '.join(HIDDEN_IN_SHAPES)}",
                case=case.name,
            )
    families = list(FAMILIES)
    return [
        replace(case, name=f"{case.name}-{family}", shape=family)
        for number, case in enumerate(cases)
        for family in [families[number % len(families)]]
    ]


def _checked_kinds(kinds: Sequence[str] | None) -> list[str]:
    if unknown := [kind for kind in kinds or () if kind not in KINDS]:
        raise RunError(
            f"no kind of case is called {unknown[0]!r}; known are {', '.join(KINDS)}",
            kind=unknown[0],
        )
    return [kind for kind in KINDS if (kind != "fault" if kinds is None else kind in kinds)]


def _checked_effects(effects: Sequence[str] | None) -> tuple[str, ...]:
    from palpate.synthetic import HIDDEN, WEIGHED

    chosen = tuple(WEIGHED if effects is None else dict.fromkeys(effects))
    if unknown := [effect for effect in chosen if effect not in HIDDEN]:
        raise RunError(
            f"the virtual bench cannot hide {', '.join(unknown)}; it knows {', '.join(HIDDEN)}",
            effect=unknown[0],
        )
    return chosen


def _interleaved(kinds: Sequence[str], count: int) -> list[str]:
    """Order `count` kinds by their shares; next is always the kind furthest behind its share."""
    if count and not kinds:
        raise RunError("no kind of case is left to be drawn: name others, or fewer controls")
    shares = {kind: MIX[kind] or _ASKED for kind in kinds}
    total = sum(shares.values())
    met = dict.fromkeys(kinds, 0)
    order: list[str] = []
    for place in range(count):
        kind = max(kinds, key=lambda one: (place + 1) * shares[one] / total - met[one])
        met[kind] += 1
        order.append(kind)
    return order


def _hidden(kind: str, seed: int, number: int, effects: Sequence[str]) -> tuple[str, ...]:
    choices = _choices(kind, effects)
    turn, place = divmod(number, len(choices))
    order = np.random.default_rng([seed, 15485863, KINDS.index(kind), turn]).permutation(
        len(choices)
    )
    return choices[int(order[place])]


def _choices(kind: str, effects: Sequence[str]) -> list[tuple[str, ...]]:
    from palpate.synthetic import FAULTS, WEIGHED_DISTURBANCES

    choices: dict[str, list[tuple[str, ...]]] = {
        "control": [()],
        "pair": list(combinations(effects, 2)),
        "outside": [(name,) for name in WEIGHED_DISTURBANCES],
        "twins": [(effect,) for effect in effects if effect in ALIKE],
        "modulus": [("young_modulus",)],
        "fault": [(name,) for name in FAULTS],
    }
    found = choices.get(kind, [(effect,) for effect in effects])
    if not found:
        raise RunError(
            f"{', '.join(effects) or 'no effect'} gives no case of the kind {kind}; name other "
            "effects, or leave it out",
            kind=kind,
        )
    return found
