"""Small changes of a setup, and the checks of what they may change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.mesh.cast_mesh import recast
from palpate.mesh.protocol import Mesh
from palpate.mesh.tet_mesh import TetMesh
from palpate.replay.material_history import require_memoryless
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = [
    "TOOL_STEP",
    "Change",
    "is_compliant",
    "mesh_in",
    "require_history_free",
    "require_same_grid",
    "same_body",
    "tool_shift",
]

Change = tuple[Setup, FloatArray]
"""A Setup that differs a little from the block's, and the motion of the tool's stated centre that
goes with it (3,) [m]."""

TOOL_STEP = 5e-7
"""Motion of the tool over which residuals are differenced [m]. It is so short that no further
surface point comes into contact."""


def require_same_grid(block: Replay, setups: Sequence[Setup]) -> None:
    """Raise SetupError if a changed setup is meshed with another element size."""
    for setup in setups:
        if setup.element_size != block.setup.element_size:
            message = (
                "a grid of other elements is no small change of this one; "
                "take differences of whole replays"
            )
            raise SetupError(message, key="element_size", value=setup.element_size)


def require_history_free(*setups: Setup) -> None:
    """Raise SetupError if a frame of one of the setups depends on those before it."""
    message = (
        "a frame that depends on those before it has no first-order changes of its own; "
        "compute those of the whole replay"
    )
    for setup in setups:
        require_memoryless(setup.material, f"{message}, or")
        if setup.has_history:
            raise SetupError(message, key="friction_coefficient")


def same_body(block: Replay, setup: Setup) -> bool:
    """Whether the setup differs from the block's in tool, sensor and modulus at most.

    The modulus does not matter because all potentials are divided by it.
    """
    here = block.setup
    material = replace(setup.material, young_modulus=here.material.young_modulus)
    parts = ("load", "support", "geometry", "cast")
    return material == here.material and all(
        getattr(setup, part) == getattr(here, part) for part in parts
    )


def mesh_in(block: Replay, setup: Setup, frame: Equilibrium) -> Mesh:
    """The frame's mesh, moved to the setup's body if that has another size or another cast."""
    if setup.cast != block.setup.cast and isinstance(frame.mesh, TetMesh):
        return recast(frame.mesh, block.setup, setup)
    if setup.geometry == block.setup.geometry:
        return frame.mesh
    return frame.mesh.scaled(np.array(setup.geometry.size) / np.array(block.setup.geometry.size))


def tool_shift(block: Replay, setup: Setup, move: FloatArray) -> FloatArray:
    """Motion of the centre of a rigidly held tool (3,) [m]: change of its offset plus `move`."""
    return np.asarray(np.array(setup.tool.offset) - np.array(block.setup.tool.offset) + move)


def is_compliant(*setups: Setup) -> bool:
    """Whether the tool is mounted on a spring in any of the setups."""
    return any(setup.tool.compliance_times_stiffness for setup in setups)
