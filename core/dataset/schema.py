"""Keys of dataset.toml, format 1: statements about phantom, tool, landmarks, camera and splits."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from palpate.dataset.files import problem, read_toml
from palpate.foundation.errors import DatasetError, SetupError
from palpate.foundation.frames import Transform
from palpate.setup.depth_filters import DEPTH_FILTERS

__all__ = ["FILE", "DatasetConfig", "nearest", "read_config"]

FILE = "dataset.toml"
_LIMIT = 2**20

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class DatasetConfig:
    """Statements of dataset.toml, SI units.

    Attributes:
        name: of the dataset.
        size: edge lengths of the box (x, y, z) [m]; of a mesh its extent, once its surface was
            read.
        surface: file of a mesh, phantom frame, metres; empty for a box.
        mass: of the phantom [kg].
        fixed: support of the phantom, always "base".
        young_modulus: believed [Pa].
        poisson_ratio: believed [1].
        tool_radius: believed radius of the spherical tip [m].
        landmarks: name to position [m], phantom frame.
        touch_offset: height of the tool centre over the landmark at a touch [m].
        touch_sigma: standard deviation of one coordinate of a touch [m]; None if not stated.
        has_camera: whether there is a [camera] table; without one the next three are defaults.
        camera_name: for reports.
        depth_sigma: the maker's stated accuracy of depth [m].
        to_phantom: first guess of phantom_from_camera; None without.
        camera_filters: names of the filters on its images.
        edge: width of the band along the phantom's edges in which depth is rounded [m]; the widest
            of the filters' if not stated.
        train: names of sequences for the fit.
        validation: names of sequences for validation.
        test: names of sequences for the test.
    """

    name: str
    size: Vector
    surface: str
    mass: float
    fixed: str
    young_modulus: float
    poisson_ratio: float
    tool_radius: float
    landmarks: dict[str, Vector]
    touch_offset: float
    touch_sigma: float | None
    has_camera: bool
    camera_name: str
    depth_sigma: float
    to_phantom: Transform | None
    camera_filters: tuple[str, ...]
    edge: float
    train: tuple[str, ...]
    validation: tuple[str, ...]
    test: tuple[str, ...]


def read_config(root: Path) -> DatasetConfig:
    """Read and check dataset.toml; every DatasetError names the key, the value and what is
    expected.
    """
    top = _Keys("", read_toml(root, FILE, _LIMIT))
    top.only(("format", "name", "phantom", "tool", "landmarks", "camera", "splits", "topics"))
    if (version := top.take("format")) != 1 or isinstance(version, bool):
        raise top.wrong("format", version, "1, the only version there is: convert the dataset")
    if "topics" in top.values:
        raise top.wrong(
            "topics",
            None,
            "a dataset without it: bags are not read yet, export them to csv and ply",
        )
    return DatasetConfig(
        name=top.name("name"),
        **_phantom(top.table("phantom")),
        tool_radius=_tool(top.table("tool")),
        **_landmarks(top.table("landmarks")),
        **_camera(top.table("camera") if "camera" in top.values else None),
        **_splits(top.table("splits")),
    )


def nearest(name: str, known: Iterable[str]) -> str:
    """Words that name the nearest known name, if any is near, and all known names."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=1)
    return (
        (f"did you mean '{close[0]}'? " if close else "") + "Known: " + (", ".join(known) or "none")
    )


class _Keys:
    """One table of the file, which returns checked values; messages name its place."""

    def __init__(self, prefix: str, values: dict[str, Any]) -> None:
        self.prefix = prefix
        self.values = values

    def wrong(self, key: str, value: object, expected: str) -> DatasetError:
        shown = None if value is None else _shown(value)
        found = "" if shown is None else f" = {shown}"
        return problem(
            FILE,
            f"{self.prefix}{key}{found}; expected {expected}",
            key=self.prefix + key,
            value=shown,
        )

    def only(self, known: tuple[str, ...]) -> None:
        for key in self.values:
            if key not in known:
                raise problem(
                    FILE,
                    f"{self.prefix}{key} is an unknown key; {nearest(key, known)}",
                    key=self.prefix + key,
                )

    def take(self, key: str) -> Any:
        if key not in self.values:
            raise problem(
                FILE,
                f"{self.prefix}{key} is missing; expected this key: add it",
                key=self.prefix + key,
            )
        return self.values[key]

    def table(self, key: str) -> _Keys:
        value = self.take(key)
        if not isinstance(value, dict):
            raise self.wrong(key, value, f"a table: write [{key}] and its keys below it")
        return _Keys(f"{self.prefix}{key}.", value)

    def text(self, key: str) -> str:
        value = self.take(key)
        if (
            not isinstance(value, str)
            or not value.strip()
            or not value.isprintable()
            or len(value) > 200
        ):
            raise self.wrong(key, value, "a name in quotes: write one")
        return value

    def name(self, key: str) -> str:
        value = self.text(key)
        if "/" in value or "\\" in value or value.startswith("."):
            raise self.wrong(key, value, "a plain name without slashes or a leading dot: rename it")
        return value

    def choice(self, key: str, only: str, why: str) -> str:
        value = self.take(key)
        if value != only:
            raise self.wrong(key, value, f"'{only}': {why}")
        return only

    def number(
        self, key: str, low: float, high: float, unit: str, default: float | None = None
    ) -> float:
        if default is not None and key not in self.values:
            return default
        return self.finite(key, self.take(key), low, high, unit)

    def vector(self, key: str, low: float, high: float) -> Vector:
        value = self.take(key)
        if not isinstance(value, list) or len(value) != 3:
            raise self.wrong(key, value, "three numbers [x, y, z] in metres: write all three")
        return cast(
            Vector,
            tuple(self.finite(f"{key}[{i}]", one, low, high, "m") for i, one in enumerate(value)),
        )

    def names(self, key: str, kind: str = "sequences") -> tuple[str, ...]:
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
            raise self.wrong(key, value, f"a list of names of {kind} in quotes")
        return tuple(value)

    def finite(self, key: str, value: object, low: float, high: float, unit: str) -> float:
        span = f"a number from {low:g} to {high:g} {unit}".rstrip()
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.wrong(key, value, f"{span}: write it without quotes")
        number = float(value) if abs(value) < 1e300 else math.inf
        if not math.isfinite(number) or not low <= number <= high:
            raise self.wrong(key, value, span + _unit_hint(number, low, high, unit))
        return number


def _shown(value: object) -> str:
    try:
        return f"{value!r:.80}"
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a number of thousands of digits"


def _unit_hint(value: float, low: float, high: float, unit: str) -> str:
    """Words that suggest another unit where a factor of 1000 brings the value into its bounds."""
    down, up = {"m": ("millimetres", ""), "kg": ("grams", ""), "Pa": ("", "kilopascals")}.get(
        unit, ("", "")
    )
    for name, factor in ((down, 1e-3), (up, 1e3)):
        if name and low <= value * factor <= high:
            return f": did you write {name}? That would be {value * factor:g} {unit}"
    return ": correct it"


def _phantom(keys: _Keys) -> dict[str, Any]:
    keys.only(("geometry", "surface", "size", "mass", "fixed", "young_modulus", "poisson_ratio"))
    return {
        **_geometry(keys),
        "mass": keys.number("mass", 1e-5, 50.0, "kg"),
        "fixed": keys.choice("fixed", "base", "only a held base is supported"),
        "young_modulus": keys.number("young_modulus", 50.0, 1e9, "Pa", default=5.0e3),
        "poisson_ratio": keys.number("poisson_ratio", -0.5, 0.4999, "", default=0.45),
    }


def _geometry(keys: _Keys) -> dict[str, Any]:
    """Keys `size` and `surface`: a box has the first, a mesh the second."""
    geometry = keys.take("geometry")
    if geometry not in ("box", "mesh"):
        raise keys.wrong(
            "geometry",
            geometry,
            "'box', or 'mesh' with surface = \"phantom.stl\": name one of the two",
        )
    if geometry == "box":
        if "surface" in keys.values:
            raise keys.wrong(
                "surface", keys.values["surface"], "no surface for a box: remove this key"
            )
        return {"size": keys.vector("size", 1e-3, 2.0), "surface": ""}
    if "size" in keys.values:
        raise keys.wrong(
            "size", keys.values["size"], "no size for a mesh, whose surface has it: remove this key"
        )
    return {"size": (0.0, 0.0, 0.0), "surface": keys.name("surface")}


def _tool(keys: _Keys) -> float:
    keys.only(("shape", "radius"))
    keys.choice("shape", "sphere", "only a sphere is supported")
    return keys.number("radius", 1e-4, 0.2, "m")


def _landmarks(keys: _Keys) -> dict[str, Any]:
    offset = keys.number("touch_offset", -0.2, 0.2, "m", default=0.0)
    sigma = keys.number("touch_sigma", 1e-6, 0.05, "m") if "touch_sigma" in keys.values else None
    names = [name for name in keys.values if name not in ("touch_offset", "touch_sigma")]
    return {
        "landmarks": {name: keys.vector(name, -2.0, 2.0) for name in names},
        "touch_offset": offset,
        "touch_sigma": sigma,
    }


def _camera(keys: _Keys | None) -> dict[str, Any]:
    if keys is None:
        return {
            "has_camera": False,
            "camera_name": "",
            "depth_sigma": 0.002,
            "to_phantom": None,
            "camera_filters": (),
            "edge": 0.0,
        }
    keys.only(("name", "depth_sigma", "to_phantom", "filters", "edge"))
    filters = _filters(keys)
    widest = max((DEPTH_FILTERS[name].edge for name in filters), default=0.0)
    return {
        "has_camera": True,
        "camera_name": keys.text("name"),
        "depth_sigma": keys.number("depth_sigma", 1e-6, 0.1, "m"),
        "to_phantom": _pose(keys, "to_phantom") if "to_phantom" in keys.values else None,
        "camera_filters": filters,
        "edge": keys.number("edge", 0.0, 0.02, "m", default=widest),
    }


def _filters(keys: _Keys) -> tuple[str, ...]:
    """Names of the filters on the camera's images."""
    filters = keys.names("filters", "filters")
    for name in filters:
        if name not in DEPTH_FILTERS:
            raise keys.wrong("filters", name, f"a known filter; {nearest(name, DEPTH_FILTERS)}")
    return filters


def _pose(keys: _Keys, key: str) -> Transform:
    rows = keys.take(key)
    if (
        not isinstance(rows, list)
        or len(rows) != 4
        or any(not isinstance(row, list) or len(row) != 4 for row in rows)
    ):
        raise keys.wrong(key, rows, "a 4x4 matrix, row major: four rows of four numbers")
    units = ("", "", "", "m")
    matrix = [
        [keys.finite(f"{key}[{i}][{j}]", row[j], -10.0, 10.0, units[j]) for j in range(4)]
        for i, row in enumerate(rows)
    ]
    if matrix[3] != [0.0, 0.0, 0.0, 1.0]:
        raise keys.wrong(key, matrix[3], "0, 0, 0, 1 in the last row: write the matrix row by row")
    try:
        return Transform.from_matrix(matrix)
    except SetupError:
        expected = (
            "a rotation in its upper left 3x3, right-handed and without scale: correct the "
            "signs and the unit"
        )
        raise keys.wrong(key, matrix, expected) from None


def _splits(keys: _Keys) -> dict[str, Any]:
    keys.only(("train", "validation", "test"))
    keys.take("train")
    splits = {key: keys.names(key) for key in ("train", "validation", "test")}
    if not splits["train"]:
        raise keys.wrong("train", [], "at least one sequence to fit on: name one")
    home: dict[str, str] = {}
    for split, names in splits.items():
        for name in names:
            if name in home:
                where = "twice" if home[name] == split else f"in {home[name]} too"
                raise keys.wrong(
                    split, name, f"each sequence in one split, it is {where}: remove one"
                )
            home[name] = split
    return dict(splits)
