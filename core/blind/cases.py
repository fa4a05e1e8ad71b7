"""What is hidden in which case: kinds of cases, their mix, and the scenario that follows from a
case's seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.foundation.errors import RunError

if TYPE_CHECKING:
    from palpate.synthetic import Scenario

__all__ = ["ALIKE", "KINDS", "MIX", "Case", "all_cases", "draw_cases", "scenario_of"]

KINDS = ("control", "clear", "subtle", "pair", "outside", "twins", "modulus")
"""Nothing hidden; one effect at a clear size, or at a share of it; two effects; what no effect
expresses; one effect of the family that looks alike; another Young's modulus alone, which without a
measured force does not show."""

MIX: Mapping[str, float] = {
    "control": 0.25,
    "clear": 0.30,
    "subtle": 0.15,
    "pair": 0.125,
    "outside": 0.075,
    "twins": 0.05,
    "modulus": 0.05,
}
"""Shares of a drawn suite: of 200 scenarios 50 hide nothing, so that one false alarm in 50 can be
seen."""

ALIKE = (
    "tool_radius",
    "tool_offset",
    "tool_compliance",
    "surface_layer",
    "stiffness_gradient",
    "strain_stiffening",
)
"""Effects that all press deeper: each imitates most of the others' pattern on a push from above."""

_KIND_SEEDS, _SUITE_SEEDS = 100_000, 1_000_000


@dataclass(frozen=True)
class Case:
    """One dataset to be made.

    Attributes:
        name: also says what is hidden.
        seed: of everything random in it.
        kind: one of KINDS.
        hidden: names of the effects, or of the disturbance.
        short: whether only five sequences are recorded, not seven.
    """

    name: str
    seed: int
    kind: str
    hidden: tuple[str, ...] = ()
    short: bool = False

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self) | {"hidden": list(self.hidden)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Case:
        """The inverse."""
        return cls(**{**data, "hidden": tuple(data["hidden"])})


def all_cases(
    seed: int, controls: int = 10, effects: Sequence[str] | None = None, short: bool = False
) -> list[Case]:
    """Each effect once, each disturbance once, and the controls; every case has a seed of its own.

    Effects are those of `palpate.synthetic.WEIGHED`, or the ones named, of which the virtual bench
    can also hide Young's modulus; an unknown one is a RunError.
    """
    from palpate.synthetic import DISTURBANCES, HIDDEN

    wanted, known = _checked_effects(effects), list(HIDDEN)
    cases = [
        Case(f"{effect}-{seed}", 1000 * seed + 1 + known.index(effect), "clear", (effect,), short)
        for effect in wanted
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
    """A suite of `count` cases in the proportions of MIX; with more of them the first stay the
    same.

    Args:
        seed: everything that is hidden follows from it.
        kinds: those wanted, all without it.
        effects: to be hidden, those of `palpate.synthetic.WEIGHED` without it.
        controls: so many of the cases hide nothing; as MIX has it without.

    Within a kind each effect (pair, disturbance) comes once before any comes again. Raises RunError
    for unknown names.
    """
    wanted = _checked_kinds(kinds)
    effects = _checked_effects(effects)
    if controls is not None and controls > count:
        raise RunError(
            f"{controls} controls are more than the {count} scenarios asked for", controls=controls
        )
    drawn = [kind for kind in wanted if kind != "control"] if controls is not None else wanted
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


def scenario_of(case: Case) -> Scenario:
    """What the virtual bench is to make of a case: follows from its kind, its hidden names and its
    seed alone.
    """
    from palpate.synthetic import SHORT_PROTOCOL, Scenario, draw_disturbance, draw_scenario

    if case.kind == "control":
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
    # Nobody sees that a block has slid by a millimetre, and it is pushed on where it lies.
    scenario = replace(scenario, put_back=scenario.hidden("base_slip") is None)
    return replace(scenario, sequences=SHORT_PROTOCOL) if case.short else scenario


def _pressing(scenario: Scenario) -> Scenario:
    """An offset of the tool looks like the others of the family only along the vertical: all of its
    length goes there.
    """
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
    if strange := [kind for kind in kinds or () if kind not in KINDS]:
        raise RunError(
            f"no kind of case is called {strange[0]!r}; known are {', '.join(KINDS)}",
            kind=strange[0],
        )
    return [kind for kind in KINDS if kinds is None or kind in kinds]


def _checked_effects(effects: Sequence[str] | None) -> tuple[str, ...]:
    from palpate.synthetic import HIDDEN, WEIGHED

    wanted = tuple(WEIGHED if effects is None else dict.fromkeys(effects))
    if strange := [effect for effect in wanted if effect not in HIDDEN]:
        raise RunError(
            f"the virtual bench cannot hide {', '.join(strange)}; it knows {', '.join(HIDDEN)}",
            effect=strange[0],
        )
    return wanted


def _interleaved(kinds: Sequence[str], count: int) -> list[str]:
    """Kinds in their shares, one by one: next comes the kind that is furthest behind its share."""
    if count and not kinds:
        raise RunError("no kind of case is left to be drawn: name others, or fewer controls")
    total = sum(MIX[kind] for kind in kinds)
    met = dict.fromkeys(kinds, 0)
    found: list[str] = []
    for place in range(count):
        kind = max(kinds, key=lambda one: (place + 1) * MIX[one] / total - met[one])
        met[kind] += 1
        found.append(kind)
    return found


def _hidden(kind: str, seed: int, number: int, effects: Sequence[str]) -> tuple[str, ...]:
    choices = _choices(kind, effects)
    turn, place = divmod(number, len(choices))
    order = np.random.default_rng([seed, 15485863, KINDS.index(kind), turn]).permutation(
        len(choices)
    )
    return choices[int(order[place])]


def _choices(kind: str, effects: Sequence[str]) -> list[tuple[str, ...]]:
    from palpate.synthetic import DISTURBANCES

    choices: dict[str, list[tuple[str, ...]]] = {
        "control": [()],
        "pair": list(combinations(effects, 2)),
        "outside": [(name,) for name in DISTURBANCES],
        "twins": [(effect,) for effect in effects if effect in ALIKE],
        "modulus": [("young_modulus",)],
    }
    found = choices.get(kind, [(effect,) for effect in effects])
    if not found:
        raise RunError(
            f"{', '.join(effects) or 'no effect'} gives no case of the kind {kind}; name other "
            "effects, or leave it out",
            kind=kind,
        )
    return found
