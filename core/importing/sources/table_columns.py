"""Meaning of a table's columns and their units, proposed by names and sizes."""

from __future__ import annotations

import re

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.table_text import TextTable

__all__ = ["proposed_columns"]

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
    "file": r"file|filename|cloud|path|cloudfile",
}
_NUMBERED = {"q0": "qw", "q1": "qx", "q2": "qy", "q3": "qz"}
"""Names of the components with the real one first; source: Kuipers 1999."""
_HEADERLESS = {
    9: ("fx", "fy", "fz"),
    10: ("x", "y", "z", "qx", "qy", "qz", "qw"),
    11: ("x", "y", "z", "qx", "qy", "qz", "qw"),
}
"""Columns after stamp and frames in `ros2 topic echo --csv` of WrenchStamped, PoseStamped and
TransformStamped, by the number of columns."""
_PREFIXES = re.compile(
    r"^(field|msg|data|pose|transform|wrench|header)[./_]|^/?[a-z0-9_/]+/(?=[a-z])"
)


def proposed_columns(table: TextTable) -> tuple[ColumnRules | None, list[str]]:
    """Propose what the columns of a table mean.

    Returns:
        the rules, None where neither poses, forces nor clouds are found; and sentences on what
        was taken by size only and is to be confirmed.
    """
    found, units = _by_name(table) if table.has_header else (_by_place(table), {})
    whole = any(set(group) <= set(found) for group in (("x", "y", "z"), ("fx", "fy", "fz")))
    if not (whole or "file" in found) or ("t" not in found and "received" not in found):
        return None, []
    doubts: list[str] = []
    rules = {
        "columns": found,
        "time_unit": units.get("t") or _time_unit(table, found, doubts),
        "length_unit": units.get("x") or _length_unit(table, found, doubts),
        "force_unit": units.get("fx") or "N",
    }
    return ColumnRules.model_validate(rules), doubts


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


def _time_unit(table: TextTable, found: dict[str, str], doubts: list[str]) -> str:
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
    doubts.append(
        f"{table.file}: its times step by {step:g}; taken as {unit}, so that the stream has "
        f"{_PER_SECOND[unit] / step:.0f} Hz"
    )
    return unit


_PER_SECOND = {"ms": 1e3, "us": 1e6, "ns": 1e9}


def _length_unit(table: TextTable, found: dict[str, str], doubts: list[str]) -> str:
    if "x" not in found:
        return "m"
    places: FloatArray = np.stack([table.numbers(found[axis]) for axis in "xyz"], axis=-1)
    span = float(np.ptp(places, axis=0).max())
    # No bench moves its tool by more than a metre over a phantom, nor by less than a millimetre.
    if span <= 1.0:
        return "m"
    unit = "mm"
    doubts.append(
        f"{table.file}: its positions span {span:.3g}; taken as {unit}, a path of {span:.0f} mm"
    )
    return unit
