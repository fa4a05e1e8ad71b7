"""The ways to break a dataset: every test of bad input, of the reader, the command line and REST,
goes over this list.

`write_valid_dataset(folder)` writes a small dataset, `BREAKAGES[name](folder)` breaks it in one
way. Its `.where` and `.says` are what the error has to tell: the values of its place, and words of
its message.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from breakage import (
    Breakage,
    change,
    change_rows,
    keep_rows,
    make_folder,
    remove,
    replace,
    scale_columns,
    set_cell,
    write,
)
from small_dataset import ply_bytes, small_cloud, write_valid_dataset

__all__ = ["BREAKAGES", "REPRESENTATIVE", "Breakage", "write_valid_dataset"]


_TOML = "dataset.toml"
_TOUCHES = "touches.csv"
_POKE = "sequences/poke-01"
_KINEMATICS = f"{_POKE}/kinematics.csv"
_CLOUDS = f"{_POKE}/clouds.csv"
_CLOUD = f"{_POKE}/clouds/000002.ply"
_FORCES = f"{_POKE}/forces.csv"


def _points(file: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], object]:
    return write(file, ply_bytes(change(small_cloud())))


def _with_nan(points: np.ndarray) -> np.ndarray:
    points[6, 2] = np.nan
    return points


def _become_file(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_text("not a folder")


def _leave_by_link(folder: Path) -> None:
    outside = folder.parent / f"{folder.name}-outside.ply"
    (folder / _CLOUD).rename(outside)
    os.symlink(outside, folder / _CLOUD)


def _leave_by_pipe(folder: Path) -> None:
    (folder / _CLOUD).unlink()
    os.mkfifo(folder / _CLOUD)


def _without_measurements(folder: Path) -> None:
    for file in (_CLOUDS, _FORCES):
        (folder / file).unlink()
    shutil.rmtree(folder / _POKE / "clouds")


def _empty_sequences(folder: Path) -> None:
    shutil.rmtree(folder / "sequences")
    (folder / "sequences").mkdir()


def _ascii_cloud(body: str) -> str:
    return (
        "ply\nformat ascii 1.0\nelement vertex 2\n"
        + "".join(f"property float {axis}\n" for axis in "xyz")
        + "end_header\n"
        + body
    )


def _key(old: str, new: str, key: str, *says: str, **where: Any) -> Breakage:
    return Breakage(replace(_TOML, old, new), {"file": _TOML, "key": key, **where}, says)


_FOLDER = {
    "folder missing": Breakage(shutil.rmtree, {}, ("does not exist", "dataset.toml")),
    "folder is a file": Breakage(_become_file, {}, ("is a file", "expected the folder")),
    "no sequences folder": Breakage(
        remove("sequences"), {"file": "sequences"}, ("expected one folder per sequence",)
    ),
    "no sequence": Breakage(
        _empty_sequences, {"file": "sequences"}, ("no sequence", "kinematics.csv")
    ),
    "a bag": Breakage(
        write("sequences/poke-02.bag", b"#ROSBAG"),
        {"file": "sequences/poke-02.bag"},
        ("[topics]", "palpate import"),
    ),
    "neither clouds nor forces": Breakage(
        _without_measurements, {"file": _POKE}, ("neither", "expected at least one")
    ),
}

_SYNTAX = {
    "no dataset.toml": Breakage(remove(_TOML), {"file": _TOML}, ("not found", "add it")),
    "dataset.toml is a folder": Breakage(
        make_folder(_TOML), {"file": _TOML}, ("is a folder", "plain file")
    ),
    "dataset.toml empty": Breakage(
        write(_TOML, ""), {"file": _TOML, "key": "format"}, ("missing",)
    ),
    "toml syntax": Breakage(
        replace(_TOML, "0.10401", "0.104 01"),
        {"file": _TOML, "row": 7},
        ("not valid TOML", "line 7"),
    ),
    "toml not utf-8": Breakage(
        replace(_TOML, b"test camera", b"cam\xe9ra"), {"file": _TOML, "row": 22}, ("UTF-8", "0xe9")
    ),
    "toml nested without end": Breakage(
        write(_TOML, "a = " + "[" * 100_000), {"file": _TOML}, ("not valid TOML",)
    ),
    "toml too large": Breakage(
        write(_TOML, "#" * (2**20 + 1)), {"file": _TOML}, ("larger than 1 MiB",)
    ),
    "another format": _key("format = 1", "format = 2", "format", "= 2", "expected 1"),
}

_KEYS = {
    "unknown key at the top": _key(
        "format = 1", "format = 1\nauthor = 'me'", "author", "unknown key", "Known: camera"
    ),
    "unknown table": _key("[tool]", "[tol]\n[tool]", "tol", "unknown key", "did you mean 'tool'"),
    "unknown key of the phantom": _key(
        "mass =", "mas =", "phantom.mas", "unknown key", "did you mean 'mass'"
    ),
    "unknown key of the tool": _key(
        "radius =", "diameter =", "tool.diameter", "unknown key", "radius"
    ),
    "unknown key of the camera": _key(
        "depth_sigma", "depth_sgima", "camera.depth_sgima", "did you mean 'depth_sigma'"
    ),
    "unknown filter of the camera": _key(
        "depth_sigma",
        'filters = ["spatal"]\ndepth_sigma',
        "camera.filters",
        "'spatal'",
        "did you mean 'spatial'",
    ),
    "edge in millimetres": _key(
        "depth_sigma", "edge = 3\ndepth_sigma", "camera.edge", "did you write millimetres"
    ),
    "unknown split": _key("test =", "tests =", "splits.tests", "did you mean 'test'"),
    "no radius": _key("radius = 0.005\n", "", "tool.radius", "missing", "add it"),
    "no camera": _key(
        '[camera]\nname = "test camera"\ndepth_sigma = 0.002\n', "", "camera", "missing", "clouds"
    ),
    "no tool": _key('[tool]\nshape = "sphere"\nradius = 0.005', "", "tool", "missing"),
    "a table is a number": Breakage(
        change(_TOML, lambda data: b"splits = 3\n" + data.split(b"[splits]")[0]),
        {"file": _TOML, "key": "splits"},
        ("a table",),
    ),
    "another geometry": _key(
        '"box"', '"ball"', "phantom.geometry", "'ball'", "expected 'box', or 'mesh'", value="'ball'"
    ),
    "mesh with a size": _key(
        '"box"',
        '"mesh"',
        "phantom.size",
        "expected no size for a mesh",
        value="[0.0687, 0.0393, 0.0358]",
    ),
    "another tool": _key('"sphere"', '"cone"', "tool.shape", "'cone'", "expected 'sphere'"),
    "size in millimetres": _key(
        "[0.0687, 0.0393, 0.0358]",
        "[68.7, 39.3, 35.8]",
        "phantom.size[0]",
        "= 68.7",
        "millimetres",
        "0.0687 m",
    ),
    "size with two numbers": _key(
        "[0.0687, 0.0393, 0.0358]", "[0.0687, 0.0393]", "phantom.size", "three numbers"
    ),
    "size as text": _key(
        "[0.0687, 0.0393", '["68.7 mm", 0.0393', "phantom.size[0]", "'68.7 mm'", "a number"
    ),
    "mass in grams": _key("0.10401", "104.01", "phantom.mass", "= 104.01", "grams", "0.10401 kg"),
    "mass of nan": _key("0.10401", "nan", "phantom.mass", "= nan", "a number from"),
    "mass beyond all numbers": _key("0.10401", "1" + "0" * 400, "phantom.mass", "a number from"),
    "mass beyond all digits": _key(
        "0.10401", "0x" + "f" * 9999, "phantom.mass", "a number from", "digits"
    ),
    "radius in millimetres": _key("0.005", "5.0", "tool.radius", "= 5.0", "millimetres", "0.005 m"),
    "modulus in kilopascals": _key(
        "mass",
        "young_modulus = 5.0\nmass",
        "phantom.young_modulus",
        "= 5.0",
        "kilopascals",
        "5000 Pa",
    ),
    "incompressible": _key(
        "mass", "poisson_ratio = 0.5\nmass", "phantom.poisson_ratio", "= 0.5", "0.4999"
    ),
    "mass is true": _key("0.10401", "true", "phantom.mass", "= True", "a number"),
    "landmark in millimetres": _key(
        "[0.03435, 0.01965", "[34.35, 19.65", "landmarks.corner_0[0]", "= 34.35", "millimetres"
    ),
    "landmark with two numbers": _key(
        "[0.03435, 0.01965, 0.0358]", "[0.03435, 0.01965]", "landmarks.corner_0", "three numbers"
    ),
    "pose of three rows": _key(
        "depth_sigma",
        "to_phantom = [[1,0,0,0],[0,1,0,0],[0,0,1,0]]\ndepth_sigma",
        "camera.to_phantom",
        "4x4",
    ),
    "pose mirrored": _key(
        "depth_sigma",
        "to_phantom = [[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\ndepth_sigma",
        "camera.to_phantom",
        "right-handed",
    ),
    "pose column major": _key(
        "depth_sigma",
        "to_phantom = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0.1,0.2,0.3,1]]\ndepth_sigma",
        "camera.to_phantom",
        "row by row",
    ),
    "split names no sequence": _key(
        '["drag-01"]', '["drag-02"]', "splits.test", "'drag-02'", "did you mean 'drag-01'"
    ),
    "sequence in two splits": _key(
        '["drag-01"]', '["poke-01"]', "splits.test", "poke-01", "in train too"
    ),
    "nothing to train on": _key('["poke-01"]', "[]", "splits.train", "at least one"),
    "topics of a bag": _key(
        "[splits]", "[topics]\npose = '/p'\n[splits]", "topics", "no sequence is a bag"
    ),
}

_TABLES = {
    "no touches": Breakage(remove(_TOUCHES), {"file": _TOUCHES}, ("not found",)),
    "three touches": Breakage(
        keep_rows(_TOUCHES, 4),
        {"file": _TOUCHES, "row": 5},
        ("3 touches", "at least 4", "residual"),
    ),
    "touch of an unknown landmark": Breakage(
        replace(_TOUCHES, "corner_2", "corner_9"),
        {"file": _TOUCHES, "row": 4, "key": "landmark"},
        ("'corner_9'", "Known: corner_0"),
    ),
    "landmark touched twice": Breakage(
        replace(_TOUCHES, "corner_2", "corner_0"), {"file": _TOUCHES, "row": 4}, ("row 2 already",)
    ),
    "touch of nan": Breakage(
        set_cell(_TOUCHES, 3, 2, "nan"),
        {"file": _TOUCHES, "row": 3, "key": "y"},
        ("'nan'", "finite number"),
    ),
    "touches in millimetres": Breakage(
        scale_columns(_TOUCHES, range(1, 4), 1e3),
        {"file": _TOUCHES, "row": 2},
        ("millimetres", "10 m"),
    ),
    "touches in kilometres": Breakage(
        scale_columns(_TOUCHES, range(1, 4), 1e-3), {"file": _TOUCHES}, ("same unit", "metres")
    ),
    "no kinematics": Breakage(remove(_KINEMATICS), {"file": _KINEMATICS}, ("not found",)),
    "kinematics without rows": Breakage(
        keep_rows(_KINEMATICS, 1), {"file": _KINEMATICS, "row": 2}, ("no rows", "at least one")
    ),
    "kinematics of one row": Breakage(
        keep_rows(_KINEMATICS, 2), {"file": _KINEMATICS, "row": 3}, ("one row", "at least two")
    ),
    "kinematics header swapped": Breakage(
        replace(_KINEMATICS, "t,x,y,z,qx,qy,qz,qw", "t,qx,qy,qz,qw,x,y,z"),
        {"file": _KINEMATICS, "row": 1},
        ("expected 't,x,y,z,qx",),
    ),
    "kinematics columns swapped": Breakage(
        change_rows(_KINEMATICS, 0, lambda c: [c[0], *c[4:], *c[1:4]]),
        {"file": _KINEMATICS, "row": 2},
        ("norm", "expected 1", "order"),
    ),
    "kinematics nan": Breakage(
        set_cell(_KINEMATICS, 57, 3, "NaN"),
        {"file": _KINEMATICS, "row": 57, "key": "z"},
        ("'NaN'", "finite"),
    ),
    "kinematics infinite": Breakage(
        set_cell(_KINEMATICS, 58, 1, "-inf"),
        {"file": _KINEMATICS, "row": 58, "key": "x"},
        ("'-inf'",),
    ),
    "kinematics text": Breakage(
        set_cell(_KINEMATICS, 9, 1, "n/a"),
        {"file": _KINEMATICS, "row": 9, "key": "x"},
        ("'n/a'", "number"),
    ),
    "kinematics with underscore": Breakage(
        set_cell(_KINEMATICS, 9, 1, "0_1"), {"file": _KINEMATICS, "row": 9, "key": "x"}, ("'0_1'",)
    ),
    "time goes back": Breakage(
        set_cell(_KINEMATICS, 80, 0, "100.1"),
        {"file": _KINEMATICS, "row": 80, "key": "t"},
        ("t = 100.1 s", "does not increase", "row 79"),
    ),
    "time stands still": Breakage(
        change_rows(_KINEMATICS, 81, lambda c: ["100.39000", *c[1:]]),
        {"file": _KINEMATICS, "row": 81, "key": "t"},
        ("does not increase",),
    ),
    "kinematics column lost": Breakage(
        change_rows(_KINEMATICS, 40, lambda c: c[:-1]),
        {"file": _KINEMATICS, "row": 40},
        ("7 columns", "expected 8"),
    ),
    "kinematics empty line": Breakage(
        change_rows(_KINEMATICS, 41, lambda c: [""]),
        {"file": _KINEMATICS, "row": 41},
        ("an empty line",),
    ),
    "decimal commas": Breakage(
        change(_KINEMATICS, lambda d: d.replace(b".", b",")),
        {"file": _KINEMATICS, "row": 2},
        ("columns",),
    ),
    "kinematics in millimetres": Breakage(
        scale_columns(_KINEMATICS, range(1, 4), 1e3),
        {"file": _KINEMATICS, "row": 2},
        ("millimetres", "10 m"),
    ),
    "kinematics in milliseconds": Breakage(
        scale_columns(_KINEMATICS, range(1), 1e3),
        {"file": _KINEMATICS, "row": 3, "key": "t"},
        ("steps by 5 s", "milliseconds"),
    ),
    "kinematics in nanoseconds": Breakage(
        scale_columns(_KINEMATICS, range(1), 1e9),
        {"file": _KINEMATICS, "row": 3, "key": "t"},
        ("nanoseconds",),
    ),
    "quaternion beyond all bounds": Breakage(
        set_cell(_KINEMATICS, 7, 5, "1e300"), {"file": _KINEMATICS, "row": 7}, ("norm inf",)
    ),
    "forces header": Breakage(
        replace(_FORCES, "t,fx,fy,fz", "time,fx,fy,fz"),
        {"file": _FORCES, "row": 1},
        ("expected 't,fx",),
    ),
    "force of nan": Breakage(
        set_cell(_FORCES, 12, 2, "nan"), {"file": _FORCES, "row": 12, "key": "fy"}, ("'nan'",)
    ),
    "forces in millinewtons": Breakage(
        set_cell(_FORCES, 12, 3, "4500"),
        {"file": _FORCES, "row": 12, "key": "fz"},
        ("millinewtons",),
    ),
}

_LISTS = {
    "no clouds.csv": Breakage(remove(_CLOUDS), {"file": _CLOUDS}, ("not found",)),
    "clouds.csv without rows": Breakage(
        keep_rows(_CLOUDS, 1), {"file": _CLOUDS, "row": 2}, ("no rows",)
    ),
    "clouds.csv swapped": Breakage(
        replace(_CLOUDS, "t,file", "file,t"), {"file": _CLOUDS, "row": 1}, ("expected 't,file'",)
    ),
    "cloud stamps go back": Breakage(
        set_cell(_CLOUDS, 4, 0, "100.2"),
        {"file": _CLOUDS, "row": 4, "key": "t"},
        ("does not increase",),
    ),
    "cloud stamp of nan": Breakage(
        set_cell(_CLOUDS, 4, 0, "nan"), {"file": _CLOUDS, "row": 4, "key": "t"}, ("'nan'",)
    ),
    "clouds of another clock": Breakage(
        scale_columns(_CLOUDS, range(1), 1e7),
        {"file": _CLOUDS, "key": "t"},
        ("same clock", "overlap"),
    ),
    "cloud missing": Breakage(
        remove(_CLOUD), {"file": _CLOUD, "row": 4}, ("not found", "clouds.csv, row 4")
    ),
    "cloud without a name": Breakage(
        set_cell(_CLOUDS, 4, 1, ""), {"file": _CLOUDS, "row": 4, "key": "file"}, ("an empty file",)
    ),
    "cloud above the folder": Breakage(
        set_cell(_CLOUDS, 4, 1, "../../rest.ply"),
        {"file": _CLOUDS, "row": 4},
        ("leads out", "inside"),
    ),
    "cloud by absolute path": Breakage(
        set_cell(_CLOUDS, 4, 1, "/etc/hostname"), {"file": _CLOUDS, "row": 4}, ("leads out",)
    ),
    "cloud through a link": Breakage(
        _leave_by_link, {"file": _CLOUD, "row": 4}, ("through a link",)
    ),
    "cloud is a pipe": Breakage(
        _leave_by_pipe, {"file": _CLOUD, "row": 4}, ("not a regular file",)
    ),
    "cloud listed twice": Breakage(
        set_cell(_CLOUDS, 5, 1, "clouds/000002.ply"),
        {"file": _CLOUDS, "row": 5, "key": "file"},
        ("row 4 already",),
    ),
}

_PLY = {
    "no rest cloud": Breakage(remove("rest.ply"), {"file": "rest.ply"}, ("not found",)),
    "rest cloud in millimetres": Breakage(
        _points("rest.ply", lambda p: p * 1e3), {"file": "rest.ply", "row": 1}, ("millimetres",)
    ),
    "rest cloud of no extent": Breakage(
        _points("rest.ply", lambda p: p * 1e-3), {"file": "rest.ply"}, ("spans", "metre")
    ),
    "cloud of no extent": Breakage(
        _points(_CLOUD, lambda p: p * 1e-3), {"file": _CLOUD}, ("spans", "metre")
    ),
    "empty cloud": Breakage(
        _points(_CLOUD, lambda p: p[:0]),
        {"file": _CLOUD, "key": "vertex"},
        ("empty cloud", "leave this frame out"),
    ),
    "cloud of zero bytes": Breakage(write(_CLOUD, b""), {"file": _CLOUD}, ("is empty", "PLY")),
    "cloud truncated": Breakage(
        change(_CLOUD, lambda d: d[:-7]),
        {"file": _CLOUD},
        ("192 points", "2297 bytes follow", "cut off"),
    ),
    "header of 10 GB": Breakage(
        replace(_CLOUD, "element vertex 192", "element vertex 900000000"),
        {"file": _CLOUD, "value": 900000000},
        ("900000000 points",),
    ),
    "cloud header cut": Breakage(
        change(_CLOUD, lambda d: d[:60]), {"file": _CLOUD}, ("end_header",)
    ),
    "cloud too long": Breakage(
        change(_CLOUD, lambda d: d + b"\0" * 12),
        {"file": _CLOUD},
        ("2304 bytes by the header", "2316 are there"),
    ),
    "cloud is another format": Breakage(
        write(_CLOUD, b"# .PCD v0.7\n"), {"file": _CLOUD}, ("expected a PLY",)
    ),
    "cloud of nan": Breakage(
        _points(_CLOUD, _with_nan), {"file": _CLOUD, "row": 7, "key": "z"}, ("z = nan", "finite")
    ),
    "cloud in millimetres": Breakage(
        _points(_CLOUD, lambda p: p * 1e3), {"file": _CLOUD, "row": 1}, ("millimetres",)
    ),
    "cloud without z": Breakage(
        replace(_CLOUD, "property float z", "property float w"),
        {"file": _CLOUD, "key": "z"},
        ("no vertex property",),
    ),
    "cloud of integers": Breakage(
        replace(_CLOUD, "float x", "int x"),
        {"file": _CLOUD, "key": "x"},
        ("integer", "float or double"),
    ),
    "cloud of unknown type": Breakage(
        replace(_CLOUD, "float x", "flaot x"), {"file": _CLOUD, "row": 4}, ("'property flaot x'",)
    ),
    "cloud with a negative count": Breakage(
        replace(_CLOUD, "vertex 192", "vertex -1"), {"file": _CLOUD, "row": 3}, ("vertex -1",)
    ),
    "ascii cloud of words": Breakage(
        write(_CLOUD, _ascii_cloud("0 0 0.3\n0.1 0.1 far\n")),
        {"file": _CLOUD, "row": 2},
        ("0.1 0.1 far",),
    ),
    "ascii cloud too short": Breakage(
        write(_CLOUD, _ascii_cloud("0.100 0.200 0.300\n")),
        {"file": _CLOUD, "row": 2},
        ("2 points", "cut off"),
    ),
    "ascii cloud of nan": Breakage(
        write(_CLOUD, _ascii_cloud("0 0 0.3\n0.1 nan 1\n")),
        {"file": _CLOUD, "row": 2, "key": "y"},
        ("y = nan",),
    ),
}

BREAKAGES: dict[str, Breakage] = {**_FOLDER, **_SYNTAX, **_KEYS, **_TABLES, **_LISTS, **_PLY}

_REPRESENTATIVE = (
    "folder missing",
    "toml syntax",
    "mass in grams",
    "touch of nan",
    "time goes back",
    "cloud truncated",
)
REPRESENTATIVE = [
    pytest.param(kind, marks=() if kind in _REPRESENTATIVE else pytest.mark.more)
    for kind in sorted(BREAKAGES)
]
"""All kinds for tests through command line and service: six in the default tier, the rest in
`more`. The reader is tested with all of them."""
