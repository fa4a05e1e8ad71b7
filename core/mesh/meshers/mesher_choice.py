"""Meshers that fill a closed surface with tetrahedra, and the choice between them."""

from __future__ import annotations

import os
from typing import Protocol

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import SetupError
from palpate.mesh.meshers.gmsh_mesher import GmshMesher
from palpate.mesh.meshers.netgen_mesher import NetgenMesher
from palpate.mesh.meshers.size_field import SizeField
from palpate.setup.free_form.shape import Shape

__all__ = ["SETTING", "SizeField", "TetMesher", "chosen_mesher"]

SETTING = "PALPATE_MESHER"
"""Environment variable that names the mesher."""


class TetMesher(Protocol):
    """A mesher; equal ones make equal meshes."""

    def __hash__(self) -> int: ...

    @property
    def name(self) -> str:
        """Its name, for readers and for the setting, in which case does not matter."""

    @property
    def package(self) -> str:
        """The package that it is installed with."""

    @property
    def is_there(self) -> bool:
        """Whether it is installed."""

    def tetrahedra(self, shape: Shape, size: SizeField) -> tuple[FloatArray, IntArray]:
        """Fill a shape; SetupError if the mesher is not installed, other errors if it fails.

        Returns:
            corners (c, 3) [m], all of them used, and tetrahedra (e, 4) of positive volume.
        """


_MESHERS: tuple[TetMesher, ...] = (GmshMesher(), NetgenMesher())
"""In the order in which they are taken where none is named."""


def chosen_mesher() -> TetMesher:
    """The mesher that the environment names; otherwise Gmsh where it is installed, else Netgen.

    Raises SetupError for a name that is not known.
    """
    named = os.environ.get(SETTING, "")
    if named:
        for mesher in _MESHERS:
            if mesher.name.lower() == named.lower():
                return mesher
        known = ", ".join(mesher.name.lower() for mesher in _MESHERS)
        raise SetupError(
            f"{SETTING} is {named!r}; expected one of {known}, or nothing", key=SETTING
        )
    return next((mesher for mesher in _MESHERS if mesher.is_there), _MESHERS[-1])
