"""Blind cases: their kinds and mix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any, TypeVar

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

T = TypeVar("T")
KINDS = ("control", "clear", "subtle", "pair", "outside", "twins", "modulus", "fault")
"""Kinds of cases: nothing hidden; one effect of clear or of subtle size; two effects; a disturbance
outside the catalogue; one effect of the family that looks alike; another Young's modulus alone,
which does not show without a measured force; a fault of the bench that effects state
(`palpate.synthetic.Nuisance.causes`). A drawn suite has no fault unless it is asked for."""

SHAPED: Mapping[str, float] = {"control": 15, "clear": 25, "pair": 10, "outside": 10}
"""Kinds of cases that the bench makes of shapes other than a block, and their numbers in a drawn
suite of 60."""

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

LOCATED = ("stiff_inclusion", "stiff_tube")
"""Effects whose place in a shape is scored. A drawn suite on shapes has three clear cases of each
before any other effect comes again."""

ALIKE = (
    "tool_radius",
    "tool_offset",
    "tool_compliance",
    "surface_layer",
    "stiffness_gradient",
    "strain_stiffening",
)
"""Effects that look alike: each reproduces most of the others' pattern in a push from above."""

_BENCH = ("nuisances", "camera", "filters", "shape", "robot", "table")
"""Facts of a case that its row states only where they are not the usual ones."""
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
        robot: how robot and phantom are related; None for touches.
        table: whether the camera gets readings of the table.
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
    robot: str | None = None
    table: bool = True

    @property
    def noisy(self) -> bool:
        """Whether the depth noise is 1 to 3 mm."""
        return self.nuisances and self.camera is None and self.seed % 2 == 1

    def to_json(self) -> dict[str, Any]:
        """Plain values; of the bench only what differs from a bench without nuisances."""
        values = asdict(self) | {"hidden": list(self.hidden)}
        if self.filters is not None:
            values["filters"] = list(self.filters)
        usual = {name: getattr(type(self), name) for name in _BENCH}
        return {
            name: value
            for name, value in values.items()
            if name not in usual or value != usual[name]
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
    *,
    shapes: bool = False,
) -> list[Case]:
    """Draw a suite in the proportions of MIX, or of SHAPED; RunError for unknown names.

    A longer suite begins with the cases of a shorter one. Within a kind each effect (pair,
    disturbance) comes once before any comes again.

    Args:
        seed: of everything that is hidden.
        count: number of cases.
        kinds: of KINDS; all without it.
        effects: to be hidden; those of `palpate.synthetic.WEIGHED` without it, of `ON_SHAPES` for
            shapes.
        controls: number of cases with nothing hidden; by the proportions without it.
        short: whether five sequences are recorded, not seven.
        shapes: whether phantoms have other shapes than a block, see `with_shapes`.
    """
    from palpate.synthetic import OF_ANY_BODY, ON_SHAPES, WEIGHED_DISTURBANCES

    mix = SHAPED if shapes else MIX
    chosen = _checked_kinds(list(SHAPED) if shapes and kinds is None else kinds)
    again = 2 * LOCATED if shapes and effects is None else ()
    effects = _checked_effects(ON_SHAPES if shapes and effects is None else effects)
    disturbances = OF_ANY_BODY if shapes else WEIGHED_DISTURBANCES
    if controls is not None and controls > count:
        raise RunError(
            f"{controls} controls are more than the {count} scenarios in all", controls=controls
        )
    drawn = [kind for kind in chosen if kind != "control"] if controls is not None else chosen
    order = [*_interleaved(drawn, count - (controls or 0), mix), *["control"] * (controls or 0)]
    met: dict[str, int] = {}
    cases = []
    for kind in order:
        number = met.setdefault(kind, 0)
        met[kind] += 1
        every = (*effects, *again) if kind == "clear" else effects
        hidden = _turned(_choices(kind, every, disturbances), seed, kind, number)
        name = "-".join([kind, str(seed), f"{number:03d}", *hidden])
        own = _SUITE_SEEDS * seed + _KIND_SEEDS * (1 + KINDS.index(kind)) + number
        cases.append(Case(name, own, kind, hidden, short))
    return with_shapes(cases, seed) if shapes else cases


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


def with_shapes(cases: Sequence[Case], seed: int) -> list[Case]:
    """The same cases with phantoms of other shapes than a block.

    Within a kind each family comes once before any comes again, and so does each relation of the
    robot, and a table that is seen or not. A longer suite begins with the cases of a shorter one.
    Raises RunError for a kind of case or an effect that the bench cannot make of a shape.

    Args:
        cases: of blocks.
        seed: of the suite.
    """
    from palpate.synthetic import FAMILIES, OF_ANY_BODY, ON_SHAPES, ROBOT_RELATIONS

    met: dict[str, int] = {}
    found = []
    for case in cases:
        known = OF_ANY_BODY if case.kind == "outside" else ON_SHAPES
        unknown = [name for name in case.hidden if name not in known]
        if case.kind not in SHAPED or case.nuisances or unknown:
            what = unknown[0] if unknown else "nuisances" if case.nuisances else case.kind
            raise RunError(
                f"{case.name}: the virtual bench has no {what} on a shape; kinds are "
                f"{', '.join(SHAPED)}, effects {', '.join(ON_SHAPES)}, and disturbances "
                f"{', '.join(OF_ANY_BODY)}",
                case=case.name,
            )
        number = met.setdefault(case.kind, 0)
        met[case.kind] += 1
        family = _turned(list(FAMILIES), seed, case.kind, number, 1)
        robot = _turned(list(ROBOT_RELATIONS), seed, case.kind, number, 2)
        table = _turned([True, False], seed, case.kind, number, 3)
        name = "-".join([case.name, family, robot, *([] if table else ["no-table"])])
        found.append(replace(case, name=name, shape=family, robot=robot, table=table))
    return found


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


def _interleaved(kinds: Sequence[str], count: int, mix: Mapping[str, float]) -> list[str]:
    """Order `count` kinds by their shares; next is always the kind furthest behind its share."""
    if count and not kinds:
        raise RunError("no kind of case is left to be drawn: name others, or fewer controls")
    shares = {kind: mix.get(kind, 0.0) or _ASKED for kind in kinds}
    total = sum(shares.values())
    met = dict.fromkeys(kinds, 0)
    order: list[str] = []
    for place in range(count):
        kind = max(kinds, key=lambda one: (place + 1) * shares[one] / total - met[one])
        met[kind] += 1
        order.append(kind)
    return order


def _turned(choices: Sequence[T], seed: int, kind: str, number: int, salt: int = 0) -> T:
    """Return one of the choices for the case of this number: each comes once before any comes
    again, in an order drawn anew for each turn.
    """
    turn, place = divmod(number, len(choices))
    salted = [salt] if salt else []
    rng = np.random.default_rng([seed, 15485863, KINDS.index(kind), turn, *salted])
    return choices[int(rng.permutation(len(choices))[place])]


def _choices(
    kind: str, effects: Sequence[str], disturbances: Sequence[str]
) -> list[tuple[str, ...]]:
    from palpate.synthetic import FAULTS

    choices: dict[str, list[tuple[str, ...]]] = {
        "control": [()],
        "pair": list(combinations(effects, 2)),
        "outside": [(name,) for name in disturbances],
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
