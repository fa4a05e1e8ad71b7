"""Blind cases: their kinds and mix, and the scenario that follows from a case's seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.foundation.errors import RunError

if TYPE_CHECKING:
    from palpate.synthetic import Scenario

__all__ = [
    "ALIKE",
    "KINDS",
    "MIX",
    "Case",
    "all_cases",
    "draw_cases",
    "scenario_of",
    "with_nuisances",
]

KINDS = ("control", "clear", "subtle", "pair", "outside", "twins", "modulus", "fault")
"""Kinds of cases: nothing hidden; one effect of clear or of subtle size; two effects; a disturbance
outside the catalogue; one effect of the family that looks alike; another Young's modulus alone,
which does not show without a measured force; a fault of the bench that effects state
(`palpate.synthetic.Nuisance.causes`). A drawn suite has no fault unless it is asked for."""

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
    """

    name: str
    seed: int
    kind: str
    hidden: tuple[str, ...] = ()
    short: bool = False
    nuisances: bool = False
    camera: str | None = None
    filters: tuple[str, ...] | None = None

    @property
    def noisy(self) -> bool:
        """Whether the depth noise is 1 to 3 mm."""
        return self.nuisances and self.camera is None and self.seed % 2 == 1

    def to_json(self) -> dict[str, Any]:
        """Plain values; of the bench only what differs from a bench without nuisances."""
        values = asdict(self) | {"hidden": list(self.hidden)}
        if self.filters is not None:
            values["filters"] = list(self.filters)
        bench = ("nuisances", "camera", "filters")
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
    from palpate.synthetic import DISTURBANCES, HIDDEN

    chosen, known = _checked_effects(effects), list(HIDDEN)
    cases = [
        Case(f"{effect}-{seed}", 1000 * seed + 1 + known.index(effect), "clear", (effect,), short)
        for effect in chosen
    ]
    if effects is None:
        cases += [
            Case(f"{name}-{seed}", 1000 * seed + 401 + place, "outside", (name,), short)
            for place, name in enumerate(DISTURBANCES)
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


def scenario_of(case: Case) -> Scenario:
    """The scenario of a case, from its kind, its hidden names and its seed alone."""
    from palpate.synthetic import (
        FILTERS,
        SHORT_PROTOCOL,
        Scenario,
        draw_disturbance,
        draw_nuisances,
        draw_scenario,
    )
    from palpate.synthetic.laws import with_second_laws

    if case.kind in ("control", "fault"):
        scenario = Scenario()
    elif case.kind == "outside":
        scenario = Scenario(
            disturbances=tuple(draw_disturbance(name, case.seed) for name in case.hidden)
        )
    else:
        scenario = draw_scenario(
            case.seed, effects=len(case.hidden), clear=case.kind != "subtle", among=case.hidden
        )
    if case.kind == "twins":
        scenario = _pressing(scenario)
    # A slip of a millimetre is not noticed, and the block is not put back.
    scenario = replace(scenario, put_back=scenario.hidden("base_slip") is None)
    if case.nuisances or case.kind == "fault":
        drawn = draw_nuisances(
            case.seed,
            noisy=case.noisy,
            camera=case.camera,
            filters=case.filters,
            faults=case.hidden if case.kind == "fault" else (),
        )
        names = tuple(name for name, kind in FILTERS.items() if kind in map(type, drawn))
        # Every other user knows the settings of the camera's driver.
        declared = names if case.seed // 2 % 2 else ()
        scenario = replace(scenario, nuisances=drawn, declared_filters=declared)
    if case.nuisances:
        scenario = with_second_laws(scenario, case.seed)
    return replace(scenario, sequences=SHORT_PROTOCOL) if case.short else scenario


def _pressing(scenario: Scenario) -> Scenario:
    """Turn a hidden offset of the tool into the vertical, where it looks like others of ALIKE."""
    from palpate.synthetic import HiddenEffect

    offset = scenario.hidden("tool_offset")
    if offset is None:
        return scenario
    length = float(np.linalg.norm([offset.value(name) for name in ("dx", "dy", "dz")]))
    deeper = round(float(np.copysign(length, offset.value("dz"))), 5)
    return replace(
        scenario, effects=(HiddenEffect("tool_offset", {"dx": 0.0, "dy": 0.0, "dz": deeper}),)
    )


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
    from palpate.synthetic import DISTURBANCES, FAULTS

    choices: dict[str, list[tuple[str, ...]]] = {
        "control": [()],
        "pair": list(combinations(effects, 2)),
        "outside": [(name,) for name in DISTURBANCES],
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
