"""A trained network as an evaluation and a recording use it: points and tool in, how far each point is moved out."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from core.dataset import Sequence as Recording
from core.errors import RunError
from core.evaluation.training import REQUEST
from core.frames import FloatArray
from core.mesh import BoxMesh, GridSpec, box_mesh
from core.meshing import Meshing
from core.setup import Setup
from core.touches import touch_correction

if TYPE_CHECKING:
    from core.correction import Trained

__all__ = ["Network"]

_CHUNK = 256


@dataclass(frozen=True, eq=False)
class Network:
    """One trained network of a block.

    Attributes:
        trained: as it was kept. nodes: of the grid that is sampled.
    """

    trained: Trained
    nodes: tuple[int, int, int]

    @classmethod
    def load(cls, folder: Path) -> Self:
        """From the folder of a training that is finished; RunError where there is none."""
        from core.correction import Trained  # noqa: PLC0415 (heavy)

        try:
            nx, ny, nz = json.loads((folder / REQUEST).read_text())["nodes"]
        except (OSError, ValueError, KeyError) as error:
            raise RunError(f"{folder} holds no training ({error}); train first", path=str(folder)) from None
        return cls(Trained.load(folder), (int(nx), int(ny), int(nz)))

    @property
    def about(self) -> dict[str, Any]:
        """What a reader wants to know of it, plain values."""
        about = self.trained.about
        return {
            "kind": about["training"]["network"]["kind"], "trust": about["training"]["network"]["trust"], "epoch": about["epoch"],
            "seed": about["training"]["seed"], "validation_error": about["error"], "validation_error_without": about["raw_error"],
        }  # fmt: skip

    @property
    def measured(self) -> bool:
        """Whether the force it is told is a sensor's."""
        return bool(self.trained.about["force"] == "measured")

    def sampled(self, setup: Setup) -> BoxMesh:
        """The grid whose points it takes."""
        return box_mesh(setup.box.size, GridSpec(nodes=self.nodes))

    def change(self, points: FloatArray, tool: FloatArray) -> FloatArray:
        """How far (n, v, 3) [m] each point of the grid (n, v, 3) [m] is moved with the tool (n, 13) there; 0 where none is."""
        import torch

        index, found = self.trained.body.index, np.zeros_like(points)
        with torch.no_grad():
            for start in range(0, len(points), _CHUNK):
                rows = slice(start, start + _CHUNK)
                own = torch.as_tensor(points[rows][:, index], dtype=torch.float32)
                moved = self.trained.network(own, torch.as_tensor(tool[rows], dtype=torch.float32)) - own
                found[rows, index] = moved.double().numpy()
        return found

    def columns(self, sequence: Recording, times: FloatArray, setup: Setup, grid: Meshing) -> FloatArray:
        """What it is told of the tool (n, 13) at cloud stamps (n,) [s] under a setup."""
        from core.correction.sampling import tool_columns  # noqa: PLC0415 (heavy)

        robot = touch_correction(setup, grid) @ setup.phantom_from_robot
        return tool_columns(sequence, times - setup.sensor.time_offset, robot, self.measured)
