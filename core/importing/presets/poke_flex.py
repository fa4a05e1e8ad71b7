"""PokeFlex (Obrist et al. 2024): a take of poking, as pokeflex-dataset/reconstruction reads it.

A take holds robot_data.json with frame, forces and T_WT (4 x 4, world from tool, metres) for each
frame, meshes/mesh-f00001.obj and so on in millimetres in the world frame, and kinect/0/ with
depth/*.png in millimetres beside camera_parameters.json with depth_intrinsics, depth_dist_coeffs
and depth_extrinsics (camera from world, since Open3D takes them as extrinsic). The scripts take the
table away along y, which is therefore up. Verified in these scripts; no file of the data was read.
Not verified: frame and sign of the forces, whether T_WT is the tip of the stick, mass and tip.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.importing.import_notes import ImportNotes
from palpate.importing.presets.preset import with_setup
from palpate.importing.proposed_mapping import recording_name
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping
from palpate.importing.sources.depth_frames_source import camera_numbers
from palpate.importing.sources.opened_sources import open_source
from palpate.importing.sources.robot_frames_source import ROBOT_DATA
from palpate.importing.stream import Source

__all__ = ["PokeFlex"]

KINECT_SIGMA = 0.011
"""Systematic error of depth of an Azure Kinect [m], as its maker states it but for 0.1 %."""
_MESH = "meshes/mesh-f00001.obj"
_CAMERA = Path("kinect") / "0"
_IDENTITY = np.eye(4).tolist()


class PokeFlex:
    """A folder with robot_data.json, meshes/ and cameras."""

    name = "pokeflex"
    summary = "a take of PokeFlex: robot_data.json, meshes, kinect"

    def fits(self, path: Path) -> bool:
        """Whether robot data and the first mesh are there."""
        return (path / ROBOT_DATA).is_file() and (path / _MESH).is_file()

    def recordings(self, path: Path) -> list[Recording]:
        """Open robot data and the first Kinect."""
        sources: list[Source] = [open_source(path / ROBOT_DATA)]
        if (path / _CAMERA / "depth").is_dir():
            sources.append(open_source(path / _CAMERA))
        return [Recording(recording_name(path), tuple(sources))]

    def completed(self, mapping: ImportMapping, path: Path, notes: ImportNotes) -> ImportMapping:
        """State the first mesh as the phantom, and robot and camera in its frame."""
        phantom: dict[str, object] = {
            "geometry": "mesh",
            "surface": _MESH,
            "unit": "mm",
            "up": [0.0, 1.0, 0.0],
            "fixed": "base",
        }
        tables: dict[str, dict[str, object]] = {"phantom": phantom}
        tables["robot"] = {"phantom_from_robot": _IDENTITY}
        if mapping.streams.cloud:
            world = np.linalg.inv(camera_numbers(path / _CAMERA, "depth_extrinsics", (4, 4)))
            tables["camera"] = {
                "name": "Azure Kinect",
                "depth_sigma": KINECT_SIGMA,
                "to_phantom": world.tolist(),
            }
        notes.decide(
            "phantom: the mesh of frame 1, in millimetres, y up; robot, meshes and camera are in "
            "the world frame of the cameras"
        )
        notes.warn(
            "frame and sign of the forces are not published: state [wrench] frame and sign; state "
            "[setup.phantom] mass and [setup.tool] too"
        )
        return with_setup(mapping, tables, path)
