"""Keys of dataset.toml, format 1: statements about phantom, tool, landmarks, camera and splits."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset.files import read_toml
from palpate.dataset.statements.checked_keys import FILE, Keys, Vector, nearest
from palpate.dataset.statements.shape_statement import (
    SHAPE_KEYS,
    ShapeStatement,
    read_shape_statement,
)
from palpate.dataset.statements.stated_pose import StatedPose, read_stated_pose
from palpate.foundation.frames import Transform
from palpate.setup.bounds import MODULI, POISSON_RATIOS, TOOL_RADII
from palpate.setup.depth_filters import DEPTH_FILTERS

__all__ = ["DatasetConfig", "read_config"]

_LIMIT = 2**20


@dataclass(frozen=True, kw_only=True)
class DatasetConfig:
    """Statements of dataset.toml, SI units.

    Attributes:
        name: of the dataset.
        size: edge lengths of the box (x, y, z) [m]; of a mesh its extent, once its surface was
            read.
        shape: statements about a mesh; None for a box.
        mass: of the phantom [kg].
        height_sigma: standard deviation of the height over what is held [m]; None if not stated.
        fixed: support of the phantom, "base" unless `shape` states another one.
        young_modulus: believed [Pa].
        poisson_ratio: believed [1].
        tool_radius: believed radius of the spherical tip [m].
        landmarks: name to position [m], phantom frame.
        touch_offset: height of the tool centre over the landmark at a touch [m].
        ball_touches: whether the ball rests on the surface at a touch, so that its centre lies one
            radius along the outward normal from the landmark; `touch_offset` is 0 then.
        touch_sigma: standard deviation of one coordinate of a touch [m]; None if not stated.
        has_camera: whether there is a [camera] table; without one the next three are defaults.
        camera_name: for reports.
        depth_sigma: the maker's stated accuracy of depth [m].
        to_phantom: first guess of phantom_from_camera; None without.
        phantom_from_robot: as a calibration gave it; None without.
        robot_from_camera: hand-eye calibration; None without.
        phantom_from_file: from the frame of the files to the phantom frame, in which z is up and
            the base lies in z = 0; all places and poses here are in the phantom frame.
        camera_filters: names of the filters on its images.
        edge: width of the band along the phantom's edges in which depth is rounded [m]; the widest
            of the filters' if not stated.
        force_sigma: standard deviation of one component of a force from the true one, beside the
            sensor's noise and bias [N]; 0 if not stated.
        synthetic_stamps: whether the stamps are made up, as of depth steps at rest.
        train: names of sequences for the fit.
        validation: names of sequences for validation.
        test: names of sequences for the test.
    """

    name: str
    size: Vector
    shape: ShapeStatement | None
    mass: float
    fixed: str
    young_modulus: float
    poisson_ratio: float
    tool_radius: float
    landmarks: dict[str, Vector]
    touch_offset: float
    ball_touches: bool
    touch_sigma: float | None
    has_camera: bool
    camera_name: str
    depth_sigma: float
    to_phantom: Transform | None
    robot_from_camera: StatedPose | None
    camera_filters: tuple[str, ...]
    edge: float
    train: tuple[str, ...]
    validation: tuple[str, ...]
    test: tuple[str, ...]
    height_sigma: float | None = None
    phantom_from_robot: StatedPose | None = None
    force_sigma: float = 0.0
    synthetic_stamps: bool = False
    phantom_from_file: Transform = field(default_factory=Transform)

    def in_phantom_frame(self, size: Vector, phantom_from_file: Transform) -> DatasetConfig:
        """Turn the statements from the files' frame into the phantom frame.

        Args:
            size: extent of the phantom [m], phantom frame.
            phantom_from_file: phantom frame from the files' frame.
        """
        turn, robot = phantom_from_file, self.phantom_from_robot
        landmarks = {name: turn.apply(np.array(place)) for name, place in self.landmarks.items()}
        return replace(
            self,
            size=size,
            landmarks={
                name: (float(x), float(y), float(z)) for name, (x, y, z) in landmarks.items()
            },
            to_phantom=None if self.to_phantom is None else turn @ self.to_phantom,
            phantom_from_robot=None if robot is None else robot.after(turn),
            phantom_from_file=turn,
        )


def read_config(root: Path) -> DatasetConfig:
    """Read and check dataset.toml; every DatasetError names the key, the value and what is
    expected.
    """
    top = Keys("", read_toml(root, FILE, _LIMIT))
    top.only(
        (
            *("format", "name", "phantom", "tool", "landmarks", "robot", "camera", "force"),
            *("motion", "splits", "topics"),
        )
    )
    if (version := top.take("format")) != 1 or isinstance(version, bool):
        raise top.wrong("format", version, "1, the only version there is: convert the dataset")
    if "topics" in top.values:
        raise top.wrong("topics", None, "no such table where no sequence is a bag: leave it out")
    return DatasetConfig(
        name=top.name("name"),
        **_phantom(top.table("phantom")),
        tool_radius=_tool(top.table("tool")),
        **_landmarks(top.table("landmarks") if "landmarks" in top.values else Keys("", {})),
        phantom_from_robot=_robot(top.table("robot")) if "robot" in top.values else None,
        **_camera(top.table("camera") if "camera" in top.values else None),
        force_sigma=_force(top.table("force")) if "force" in top.values else 0.0,
        synthetic_stamps=_motion(top.table("motion")) if "motion" in top.values else False,
        **_splits(top.table("splits")),
    )


def _phantom(keys: Keys) -> dict[str, Any]:
    common = ("geometry", "size", "mass", "height_sigma", "fixed", "young_modulus", "poisson_ratio")
    keys.only((*common, *SHAPE_KEYS))
    geometry = _geometry(keys)
    shape = geometry["shape"]
    other = shape is not None and shape.held_by != "fixed"
    if other and "fixed" in keys.values:
        expected = f"no such key beside {shape.held_by}: remove one of them"
        raise keys.wrong("fixed", keys.values["fixed"], expected)
    why = "or, for a mesh, one of fixed_surface, fixed_plane, fixed_faces, fixed_vertices instead"
    return {
        **geometry,
        "mass": keys.number("mass", 1e-5, 50.0, "kg"),
        "height_sigma": _sigma(keys, "height_sigma"),
        "fixed": shape.held_by if other else keys.choice("fixed", "base", why),
        "young_modulus": keys.number("young_modulus", *MODULI, "Pa", default=5.0e3),
        "poisson_ratio": keys.number("poisson_ratio", *POISSON_RATIOS, "", default=0.45),
    }


def _geometry(keys: Keys) -> dict[str, Any]:
    """Size of a box, or statements about a mesh."""
    geometry = keys.take("geometry")
    if geometry not in ("box", "mesh"):
        raise keys.wrong(
            "geometry",
            geometry,
            "'box', or 'mesh' with surface = \"phantom.stl\": name one of the two",
        )
    if geometry == "box":
        for key in SHAPE_KEYS:
            if key in keys.values:
                raise keys.wrong(key, keys.values[key], f"no {key} for a box: remove this key")
        return {"size": keys.vector("size", 1e-3, 2.0), "shape": None}
    if "size" in keys.values:
        raise keys.wrong(
            "size", keys.values["size"], "no size for a mesh, whose surface has it: remove this key"
        )
    return {"size": (0.0, 0.0, 0.0), "shape": read_shape_statement(keys)}


def _tool(keys: Keys) -> float:
    keys.only(("shape", "radius"))
    keys.choice("shape", "sphere", "only a sphere is supported")
    return keys.number("radius", *TOOL_RADII, "m")


def _landmarks(keys: Keys) -> dict[str, Any]:
    ball = keys.values.get("touch_offset") == "ball"
    offset = 0.0 if ball else keys.number("touch_offset", -0.2, 0.2, "m", default=0.0)
    names = [name for name in keys.values if name not in ("touch_offset", "touch_sigma")]
    return {
        "landmarks": {name: keys.vector(name, -2.0, 2.0) for name in names},
        "touch_offset": offset,
        "ball_touches": ball,
        "touch_sigma": _sigma(keys, "touch_sigma"),
    }


def _sigma(keys: Keys, name: str) -> float | None:
    """An optional standard deviation of a length [m]."""
    return keys.number(name, 1e-6, 0.05, "m") if name in keys.values else None


def _force(keys: Keys) -> float:
    keys.only(("sigma",))
    return keys.number("sigma", 0.0, 100.0, "N", default=0.0)


def _motion(keys: Keys) -> bool:
    """Whether stamps are made up."""
    keys.only(("stamps",))
    value = keys.take("stamps")
    if value not in ("measured", "synthetic"):
        expected = '"measured", or "synthetic" for depth steps at rest: write one of them'
        raise keys.wrong("stamps", value, expected)
    return bool(value == "synthetic")


def _robot(keys: Keys) -> StatedPose | None:
    keys.only(("phantom_from_robot", "position_sigma", "rotation_sigma"))
    keys.take("phantom_from_robot")
    return read_stated_pose(keys, "phantom_from_robot")


def _camera(keys: Keys | None) -> dict[str, Any]:
    if keys is None:
        return {
            "has_camera": False,
            "camera_name": "",
            "depth_sigma": 0.002,
            "to_phantom": None,
            "robot_from_camera": None,
            "camera_filters": (),
            "edge": 0.0,
        }
    poses = ("to_phantom", "robot_from_camera", "position_sigma", "rotation_sigma")
    keys.only(("name", "depth_sigma", "filters", "edge", *poses))
    filters = _filters(keys)
    widest = max((DEPTH_FILTERS[name].edge for name in filters), default=0.0)
    return {
        "has_camera": True,
        "camera_name": keys.text("name"),
        "depth_sigma": keys.number("depth_sigma", 1e-6, 0.1, "m"),
        "to_phantom": keys.pose("to_phantom") if "to_phantom" in keys.values else None,
        "robot_from_camera": read_stated_pose(keys, "robot_from_camera"),
        "camera_filters": filters,
        "edge": keys.number("edge", 0.0, 0.02, "m", default=widest),
    }


def _filters(keys: Keys) -> tuple[str, ...]:
    """Names of the filters on the camera's images."""
    filters = keys.names("filters", "filters")
    for name in filters:
        if name not in DEPTH_FILTERS:
            raise keys.wrong("filters", name, f"a known filter; {nearest(name, DEPTH_FILTERS)}")
    return filters


def _splits(keys: Keys) -> dict[str, Any]:
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
