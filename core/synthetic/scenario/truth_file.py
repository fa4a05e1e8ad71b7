"""The truth file of a virtual dataset: hidden effects and true registrations."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.foundation.frames import Transform
from palpate.synthetic.nuisances.nuisance import Nuisance
from palpate.synthetic.nuisances.nuisance_chain import described
from palpate.synthetic.scenario.disturbance import DISTURBANCES, Disturbance
from palpate.synthetic.scenario.hidden_effects import HIDDEN, HiddenEffect

if TYPE_CHECKING:
    from palpate.synthetic.scenario.scenario import Scenario

__all__ = ["Truth", "read_truth", "truth_path"]


@dataclass(frozen=True)
class Truth:
    """The hidden effects and the true registrations.

    Attributes:
        effects: empty where the verdict is none.
        visibility: root mean square change of the visible surface by the hidden effects while it is
            touched [m].
        phantom_from_camera: the camera's pose when `rest.ply` was taken.
        robot_from_phantom: true pose.
        camera_shift: phantom frame; `camera_shift @ phantom_from_camera` holds in the sequences.
        shortened: by sequence, how much shallower than planned each push was because the block was
            unstable [m].
        disturbances: outside the catalogue of effects; the verdict is then unexplained.
        begun: by sequence, offset (x, y) of a block that was not put back, at the beginning [m].
        nuisances: faults of the bench; they leave the verdict alone.
        cast: RMS offset of a free form's surface from the stated one, which leaves it alone too
            [m].
    """

    effects: tuple[HiddenEffect, ...]
    visibility: float
    phantom_from_camera: Transform
    robot_from_phantom: Transform
    camera_shift: Transform = field(default_factory=Transform)
    shortened: Mapping[str, list[float]] = field(default_factory=dict)
    disturbances: tuple[Disturbance, ...] = ()
    begun: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    nuisances: tuple[Nuisance, ...] = ()
    cast: float = 0.0

    @property
    def verdict(self) -> str:
        """The verdict of a perfect diagnosis: found, unexplained or none."""
        return "unexplained" if self.disturbances else "found" if self.effects else "none"

    def as_dict(self) -> dict[str, Any]:
        """Plain values: each parameter with its unit, the visibility in mm."""
        return {
            "verdict": self.verdict,
            "effects": [
                _described(hidden.effect, hidden.parameters, HIDDEN)
                | ({"second_law": True} if hidden.second_law else {})
                for hidden in self.effects
            ],
            **self._disturbed(),
            "visibility_mm": round(self.visibility * 1e3, 4),
            "stopped_short_mm": {
                name: [round(part * 1e3, 3) for part in parts]
                for name, parts in self.shortened.items()
            },
            "began_off_mm": {
                name: [round(part * 1e3, 4) for part in parts] for name, parts in self.begun.items()
            },
            "registration": {
                "phantom_from_camera": self.phantom_from_camera.matrix.tolist(),
                "robot_from_phantom_R": self.robot_from_phantom.rotation.tolist(),
                "robot_from_phantom_t": self.robot_from_phantom.translation.tolist(),
                "camera_shift": self.camera_shift.matrix.tolist(),
            },
        }

    def _disturbed(self) -> dict[str, Any]:
        """The entries of the disturbances and of the nuisances, where there are any."""
        entries = [_described(one.name, one.parameters, DISTURBANCES) for one in self.disturbances]
        nuisances = described(self.nuisances)
        return (
            ({"disturbances": entries} if entries else {})
            | ({"nuisances": nuisances} if nuisances else {})
            | ({"cast_mm": round(1e3 * self.cast, 4)} if self.cast else {})
        )

    def save(self, path: Path) -> None:
        """Write JSON."""
        path.write_text(json.dumps(self.as_dict(), indent=1) + "\n")


def truth_path(folder: Path) -> Path:
    """Path of the truth of the dataset in `folder`: beside it, never in it."""
    return folder.with_name(folder.name + ".truth.json")


def read_truth(folder: Path, scenario: Scenario) -> Truth:
    """Read the truth of the dataset in `folder`; lengths are those of the file, which are rounded.

    Args:
        folder: of the dataset.
        scenario: that it was made from.
    """
    data = json.loads(truth_path(folder).read_text())
    poses = data["registration"]
    return Truth(
        scenario.effects,
        1e-3 * data["visibility_mm"],
        Transform.from_matrix(poses["phantom_from_camera"]),
        Transform(np.array(poses["robot_from_phantom_R"]), np.array(poses["robot_from_phantom_t"])),
        Transform.from_matrix(poses["camera_shift"]),
        {name: [1e-3 * part for part in row] for name, row in data["stopped_short_mm"].items()},
        scenario.disturbances,
        {name: (1e-3 * x, 1e-3 * y) for name, (x, y) in data["began_off_mm"].items()},
        scenario.nuisances,
        1e-3 * data.get("cast_mm", 0.0),
    )


def _described(
    name: str, values: Mapping[str, float | str], units: Mapping[str, Mapping[str, str]]
) -> dict[str, Any]:
    return {
        "effect": name,
        "parameters": {
            key: {"value": value, "unit": units[name][key]} for key, value in values.items()
        },
    }
