"""Meaning of a table's columns and their units, proposed by names and sizes."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.importing.rules import ColumnRules
from palpate.importing.tables.table_rotation import ANGLES, NAMED, ORDERED
from palpate.importing.tables.table_text import TextTable

__all__ = ["JUMP", "ProposedColumns", "proposed_columns"]

_UNIT = re.compile(r"[\[( _]+(ns|us|µs|ms|sec|s|mm|cm|m|mN|N|deg|rad)[\])]*$")
_PATTERNS = {
    "t": r"(header\.)?(stamp|timestamp|time|t|time_stamp)",
    "received": r"%time|rosbagtimestamp|time_received|receive_time",
    "x": r"(p|pos|position|translation|tool|tip|tcp)?x",
    "y": r"(p|pos|position|translation|tool|tip|tcp)?y",
    "z": r"(p|pos|position|translation|tool|tip|tcp)?z",
    "qx": r"(q|quat|quaternion|orientation|rotation|o|rot)x",
    "qy": r"(q|quat|quaternion|orientation|rotation|o|rot)y",
    "qz": r"(q|quat|quaternion|orientation|rotation|o|rot)z",
    "qw": r"(q|quat|quaternion|orientation|rotation|o|rot)w",
    "fx": r"(f|force)x",
    "fy": r"(f|force)y",
    "fz": r"(f|force)z",
    "nx": r"(n|normal|norm|surfacenormal)x",
    "ny": r"(n|normal|norm|surfacenormal)y",
    "nz": r"(n|normal|norm|surfacenormal)z",
    "push": r"(push|poke|probe|probing|contact|point|site)(id|number|no|nr|index)?",
    "file": r"file|filename|cloud|path|cloudfile",
}
_NAMED_ANGLES = {("roll", "pitch", "yaw"): "euler-xyz", ("a", "b", "c"): "euler-ZYX"}
"""Angles whose names tell what they are: fixed axes as in REP 103 of ROS, and those of a KUKA."""
_ABOUT_AXES = r"(r|rot|rotation|theta|angle|euler|rotvec|rv)"
_FOUR = r"(q|quat|quaternion|orientation|rot|rotation)"
_NUMBERED = {"q0": "qw", "q1": "qx", "q2": "qy", "q3": "qz"}
"""Names of the components with the real one first; source: Kuipers 1999."""
_HEADERLESS = {
    9: ("fx", "fy", "fz"),
    10: ("x", "y", "z", "qx", "qy", "qz", "qw"),
    11: ("x", "y", "z", "qx", "qy", "qz", "qw"),
}
"""Columns after stamp and frames in `ros2 topic echo --csv` of WrenchStamped, PoseStamped and
TransformStamped, by the number of columns."""
_LARGEST_RADIANS = 2 * np.pi + 0.1
"""Largest angle that is one in radians; controllers state them within a turn."""
_SLOW, _SLOWEST = 0.5, 5.0
"""Step from which rows are depth steps [s], and from which it may be milliseconds of a stream."""
JUMP = 4.0
"""Ratio of a step to the median one from which it leads to another push [1]."""
_MOST_STEPS = 100
"""Depth steps of one push up to which rows without a time are pushes."""
_REPEATS = 0.05
"""Share of stamps that do not increase above which they are no times [1]."""
_PREFIXES = re.compile(
    r"^(field|msg|data|pose|transform|wrench|header)[./_]|^/?[a-z0-9_/]+/(?=[a-z])"
)


@dataclass(frozen=True)
class ProposedColumns:
    """Meaning of a table's columns as names and sizes tell it.

    Attributes:
        rules: None where neither poses, forces nor clouds are found.
        stated: quantities whose unit stands in the name of their column.
        doubts: sentences on what was taken by size only and is to be confirmed, by key of `rules`.
    """

    rules: ColumnRules | None
    stated: frozenset[str] = frozenset()
    doubts: dict[str, str] = field(default_factory=dict)


def proposed_columns(table: TextTable) -> ProposedColumns:
    """Propose what the columns of a table mean."""
    found, units = _by_name(table) if table.has_header else (_by_place(table), {})
    whole = any(set(group) <= set(found) for group in (("x", "y", "z"), ("fx", "fy", "fz")))
    at_rest = _is_at_rest(table, found)
    timed = "t" in found or "received" in found
    if not (whole or "file" in found) or not (timed or at_rest):
        return ProposedColumns(None)
    doubts: dict[str, str] = {}
    turned = _rotation(table, found, units, doubts) if "x" in found else {}
    rules = {
        "columns": found,
        "rows": "depth-steps" if at_rest else "stream",
        "time_unit": "s" if at_rest else units.get("t") or _time_unit(table, found, doubts),
        "length_unit": units.get("x") or _length_unit(table, found, doubts),
        "force_unit": units.get("fx") or "N",
        **turned,
    }
    return ProposedColumns(ColumnRules.model_validate(rules), frozenset(units), doubts)


def _is_at_rest(table: TextTable, found: dict[str, str]) -> bool:
    """Whether rows are depth steps at rest: each has a place and a force, and a push or a normal
    or no time; where they have times these do not increase, or step slowly.
    """
    if not {"x", "y", "z", "fx", "fy", "fz"} <= set(found) or "received" in found:
        return False
    told = "push" in found or {"nx", "ny", "nz"} <= set(found)
    if "t" not in found:
        return told or _jumps_between_pushes(table, found)
    if not told:
        return False
    steps = np.diff(table.numbers(found["t"].split("+")[0]))
    # Quicker than that the rows are a stream, in whatever unit.
    return bool((steps <= 0).mean() > _REPEATS or _SLOW < np.median(steps) < _SLOWEST)


def _jumps_between_pushes(table: TextTable, found: dict[str, str]) -> bool:
    """Whether places go on in small steps and jump now and then, as from push to push."""
    places = np.stack([table.numbers(found[axis]) for axis in "xyz"], axis=-1)
    places = places[np.isfinite(places).all(axis=1) & (places != 0).any(axis=1)]
    if len(places) < 4:
        return False
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    usual = float(np.median(steps))
    jumps = int((steps > JUMP * usual).sum())
    return usual > 0 and jumps > 0 and len(places) / (jumps + 1) < _MOST_STEPS


def _rotation(
    table: TextTable, found: dict[str, str], units: dict[str, str], doubts: dict[str, str]
) -> dict[str, str]:
    """Take up the columns of a rotation, and return rules of it; no rule where it is open."""
    if all(part in found for part in NAMED):
        return {}
    for part in NAMED:
        found.pop(part, None)
    four = _row_of(table, _FOUR, ("1", "2", "3", "4"))
    if four:
        found.update(zip(ORDERED, four, strict=True))
        doubts["quaternion_order"] = (
            f"{table.file}: the names of {', '.join(four)} do not tell which is the real part; "
            f'state quaternion_order = "xyzw" or "wxyz" in [tables."{table.file}"] of import.toml'
        )
        return {}
    bare = {_bare(column)[0]: column for column in table.columns}
    rotation = next((kind for names, kind in _NAMED_ANGLES.items() if set(names) <= set(bare)), "")
    names = next((names for names, kind in _NAMED_ANGLES.items() if kind == rotation), ())
    three = [bare[name] for name in names] or _row_of(table, _ABOUT_AXES, ("x", "y", "z"))
    if not three:
        return {}
    found.update(zip(ANGLES, three, strict=True))
    unit = _bare(three[0])[1]
    if not rotation:
        doubts["rotation"] = (
            f"{table.file}: {', '.join(three)} may be angles about fixed axes, about turned ones, "
            'or a rotation vector; state rotation = "euler-xyz", "euler-XYZ" or "rotation-vector" '
            f'in [tables."{table.file}"] of import.toml'
        )
    if unit in ("deg", "rad"):
        units["a1"] = unit
    else:
        unit = _angle_unit(table, three, doubts)
    return {"rotation": rotation, "angle_unit": unit}


def _row_of(table: TextTable, prefix: str, ends: tuple[str, ...]) -> list[str]:
    """Columns of one prefix and these ends, in their order; none where one is missing."""
    bare = {_bare(column)[0]: column for column in table.columns}
    for name in bare:
        match = re.fullmatch(prefix + re.escape(ends[0]), name)
        if match and all(match.group(1) + end in bare for end in ends):
            return [bare[match.group(1) + end] for end in ends]
    return []


def _angle_unit(table: TextTable, columns: list[str], doubts: dict[str, str]) -> str:
    """Unit of angles without a stated one: beyond a turn they are degrees."""
    angles: FloatArray = np.abs([table.numbers(column) for column in columns])
    largest = float(np.nanmax(angles, initial=0.0))
    unit = "deg" if largest > _LARGEST_RADIANS else "rad"
    doubts["angle_unit"] = (
        f"{table.file}: {', '.join(columns)} reach {largest:.3g}; taken as {unit}, state "
        f'angle_unit in [tables."{table.file}"] of import.toml if they are not'
    )
    return unit


def _by_name(table: TextTable) -> tuple[dict[str, str], dict[str, str]]:
    """Columns by quantity, and units that their names state."""
    found: dict[str, str] = {}
    units: dict[str, str] = {}
    for column in table.columns:
        bare, unit = _bare(column)
        for quantity, pattern in _PATTERNS.items():
            if quantity not in found and re.fullmatch(pattern, bare):
                found[quantity] = column
                if unit:
                    units[quantity] = unit
    lowered = {column.lower(): column for column in table.columns}
    if "qw" not in found and all(name in lowered for name in _NUMBERED):
        found.update({quantity: lowered[name] for name, quantity in _NUMBERED.items()})
    if "t" not in found and (seconds := _column(table, r"(sec|secs)")):
        found["t"] = seconds
        if nanoseconds := _column(table, r"(nanosec|nsec|nsecs|nanosecs)"):
            found["t"] = f"{seconds}+{nanoseconds}"
            units["t"] = "s+ns"
    return found, units


def _bare(column: str) -> tuple[str, str]:
    """Name without unit, prefixes and marks; and the unit."""
    match = _UNIT.search(column)
    unit = match.group(1).replace("µ", "u").replace("sec", "s") if match else ""
    name = (column[: match.start()] if match else column).strip().lower()
    while (shorter := _PREFIXES.sub("", name)) != name:
        name = shorter
    if name.startswith("%"):
        return name, unit
    return re.sub(r"[._\s/-]", "", name), unit


def _column(table: TextTable, pattern: str) -> str | None:
    for column in table.columns:
        if re.fullmatch(pattern, re.split(r"[._/]", column.lower())[-1]):
            return column
    return None


def _by_place(table: TextTable) -> dict[str, str]:
    """Columns of a table of `ros2 topic echo --csv`, which names none."""
    names = list(table.columns)
    if len(names) not in _HEADERLESS:
        return {}
    seconds, nanoseconds = table.whole(names[0]), table.whole(names[1])
    if seconds is None or nanoseconds is None or not 0 <= max(nanoseconds) < 10**9:
        return {}
    quantities = _HEADERLESS[len(names)]
    start = len(names) - len(quantities) - (3 if quantities[0] == "fx" else 0)
    return {"t": f"{names[0]}+{names[1]}", **dict(zip(quantities, names[start:], strict=False))}


def _time_unit(table: TextTable, found: dict[str, str], doubts: dict[str, str]) -> str:
    if "+" in found.get("t", ""):
        return "s+ns"
    times = table.numbers(found.get("t") or found["received"])
    largest = float(np.nanmax(np.abs(times)))
    for unit, least in (("ns", 1e17), ("us", 1e14), ("ms", 1e11)):
        if largest > least:
            return unit
    if largest > 1e8 or len(times) < 3:
        return "s"
    step = float(np.median(np.diff(times)))
    if step <= 0.5:
        return "s"
    unit = "ms" if step <= 500 else "us" if step <= 5e5 else "ns"
    doubts["time_unit"] = (
        f"{table.file}: its times step by {step:g}; taken as {unit}, so that the stream has "
        f"{_PER_SECOND[unit] / step:.0f} Hz"
    )
    return unit


_PER_SECOND = {"ms": 1e3, "us": 1e6, "ns": 1e9}


def _length_unit(table: TextTable, found: dict[str, str], doubts: dict[str, str]) -> str:
    if "x" not in found:
        return "m"
    places: FloatArray = np.stack([table.numbers(found[axis]) for axis in "xyz"], axis=-1)
    span = float(np.ptp(places, axis=0).max())
    # No bench moves its tool by more than a metre over a phantom, nor by less than a millimetre.
    if span <= 1.0:
        return "m"
    unit = "mm"
    doubts["length_unit"] = (
        f"{table.file}: its positions span {span:.3g}; taken as {unit}, a path of {span:.0f} mm"
    )
    return unit
