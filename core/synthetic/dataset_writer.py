"""Writers for the files of a dataset in format 1."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.synthetic.scenario.scenario import Scenario

__all__ = [
    "Calibration",
    "write_clouds",
    "write_config",
    "write_felt_config",
    "write_forces",
    "write_kinematics",
    "write_ply",
    "write_touches",
    "write_traces",
]


def write_ply(path: Path, points: FloatArray) -> None:
    """Write a binary cloud (n, 3) [m], little endian, single precision."""
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "property float x\nproperty float y\nproperty float z\nend_header\n"
    path.write_bytes(header.encode() + np.ascontiguousarray(points, dtype="<f4").tobytes())


def write_kinematics(
    path: Path, times: FloatArray, positions: FloatArray, quaternion: FloatArray
) -> None:
    """Write tool poses: times (n,) [s], positions (n, 3) [m] in the robot frame, and one
    orientation (4,) xyzw.
    """
    turn = ",".join(f"{part:.7f}" for part in quaternion)
    rows = [
        f"{t:.5f},{x:.7f},{y:.7f},{z:.7f},{turn}"
        for t, (x, y, z) in zip(times.tolist(), positions.tolist(), strict=True)
    ]
    path.write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]) + "\n")


def write_forces(path: Path, times: FloatArray, forces: FloatArray) -> None:
    """Write the force on the tool: times (n,) [s], forces (n, 3) [N] in the robot frame."""
    rows = [
        f"{t:.5f},{x:.6f},{y:.6f},{z:.6f}"
        for t, (x, y, z) in zip(times.tolist(), forces.tolist(), strict=True)
    ]
    path.write_text("\n".join(["t,fx,fy,fz", *rows]) + "\n")


def write_clouds(path: Path, times: FloatArray, files: list[str]) -> None:
    """Write the list of clouds with their time stamps (n,) [s]."""
    path.write_text(
        "\n".join(
            [
                "t,file",
                *(f"{time:.5f},{file}" for time, file in zip(times.tolist(), files, strict=True)),
            ]
        )
        + "\n"
    )


def write_touches(path: Path, names: list[str], positions: FloatArray) -> None:
    """Write tool centres (n, 3) [m], robot frame, at the touched landmarks."""
    rows = [
        f"{name},{x:.7f},{y:.7f},{z:.7f}"
        for name, (x, y, z) in zip(names, positions.tolist(), strict=True)
    ]
    path.write_text("\n".join(["landmark,x,y,z", *rows]) + "\n")


@dataclass(frozen=True, eq=False)
class Calibration:
    """A pose as a calibration gives it.

    Attributes:
        pose: with an error.
        position_sigma: standard deviation of each coordinate of its translation [m].
        rotation_sigma: standard deviation of its rotation about each axis [rad].
    """

    pose: Transform
    position_sigma: float
    rotation_sigma: float


def write_traces(path: Path, strokes: list[int], positions: FloatArray) -> None:
    """Write centres (n, 3) [m], robot frame, of the ball on the untouched surface, one every 0.1
    s.
    """
    rows = [
        f"{stroke},{0.1 * number:.1f},{x:.7f},{y:.7f},{z:.7f}"
        for number, (stroke, (x, y, z)) in enumerate(zip(strokes, positions.tolist(), strict=True))
    ]
    path.write_text("\n".join(["stroke,t,x,y,z", *rows]) + "\n")


def write_config(
    path: Path,
    name: str,
    scenario: Scenario,
    landmarks: dict[str, FloatArray],
    guess: Transform | None,
    surface: str = "",
    calibrated: Mapping[str, Calibration] = MappingProxyType({}),
) -> None:
    """Write dataset.toml: the experimenter's beliefs.

    Args:
        path: of the file.
        name: of the dataset.
        scenario: what is believed.
        landmarks: (3,) [m] by name.
        guess: first guess of the camera's pose; None without.
        surface: file of a free form's surface; empty for a block.
        calibrated: poses by their keys, phantom_from_robot and robot_from_camera.
    """
    lines = [
        *_believed(name, scenario, surface, landmarks),
        *_calibration("[robot]", "phantom_from_robot", calibrated),
        "[camera]",
        'name = "virtual depth camera"',
        "depth_sigma = 0.002",
        *([f"filters = {list(filters)}"] if (filters := scenario.declared_filters) else []),
        *([] if guess is None else [f"to_phantom = [{_rows(guess)}]"]),
        *_calibration("", "robot_from_camera", calibrated),
        "",
        *_listed(
            {split: list(names) for split, names in scenario.splits.items()}
            or _splits(scenario.sequences)
        ),
    ]
    path.write_text("\n".join(lines) + "\n")


def _calibration(table: str, key: str, calibrated: Mapping[str, Calibration]) -> list[str]:
    """Lines of a calibrated pose, below the head of its table; none without this pose."""
    if key not in calibrated:
        return []
    one = calibrated[key]
    return [
        *([table] if table else []),
        f"{key} = [{_rows(one.pose)}]",
        f"position_sigma = {one.position_sigma}",
        f"rotation_sigma = {one.rotation_sigma}",
        *([""] if table else []),
    ]


def _rows(pose: Transform) -> str:
    return ", ".join("[" + ", ".join(f"{value:.9f}" for value in row) + "]" for row in pose.matrix)


def write_felt_config(
    path: Path,
    name: str,
    scenario: Scenario,
    surface: str,
    landmarks: dict[str, FloatArray],
    splits: dict[str, list[str]],
) -> None:
    """Write dataset.toml of a palpation without a camera, of a box or a closed `surface`."""
    path.write_text(
        "\n".join([*_believed(name, scenario, surface, landmarks), *_listed(splits)]) + "\n"
    )


def _believed(
    name: str, scenario: Scenario, surface: str, landmarks: dict[str, FloatArray]
) -> list[str]:
    geometry = (
        ['geometry = "mesh"', f'surface = "{surface}"']
        if surface
        else ['geometry = "box"', f"size = {_list(scenario.size)}"]
    )
    return [
        "format = 1",
        f'name = "{name}"',
        "",
        "[phantom]",
        *geometry,
        f"mass = {scenario.mass}",
        'fixed = "base"',
        f"young_modulus = {scenario.young_modulus}",
        f"poisson_ratio = {scenario.poisson_ratio}",
        "",
        "[tool]",
        'shape = "sphere"',
        f"radius = {scenario.tool_radius}",
        "",
        "[landmarks]",
        *(f"{key} = {_list(place)}" for key, place in landmarks.items()),
        f"touch_offset = {scenario.touch_offset}",
        "",
    ]


def _listed(splits: dict[str, list[str]]) -> list[str]:
    return [
        "[splits]",
        *(
            f"{split} = [{', '.join(chr(34) + one + chr(34) for one in names)}]"
            for split, names in splits.items()
        ),
    ]


def _list(values: FloatArray | tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{value:.6g}" for value in values) + "]"


def _splits(sequences: tuple[str, ...]) -> dict[str, list[str]]:
    """Default splits: the first of each kind trains, the second top poke validates, others test."""
    splits: dict[str, list[str]] = {"train": [], "validation": [], "test": []}
    met: dict[str, int] = {}
    for name in sequences:
        kind = name.rpartition("-")[0]
        number = met.setdefault(kind, 0)
        met[kind] += 1
        splits[
            "train"
            if number == 0
            else "validation"
            if number == 1 and kind == "poke-top"
            else "test"
        ].append(name)
    return splits
