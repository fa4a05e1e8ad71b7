"""Which effects a dataset can weigh: what was measured decides, and of what shape the phantom is.

With clouds a diagnosis weighs the whole catalogue. With forces alone it weighs what changes how
hard a body resists from place to place and with the depth; what is seen alone (the camera, its
clock, the size of a block) says nothing there, and what hangs on the time since a push is over
between short ones.
"""

from __future__ import annotations

from palpate.effects import DIAGNOSED, Effect
from palpate.effects.elastic_material import PoissonRatio, StiffInclusion, YoungModulus
from palpate.effects.heterogeneity import (
    Anisotropy,
    StiffnessGradient,
    StrainStiffening,
    SurfaceLayer,
)
from palpate.effects.support import BaseCompliance
from palpate.effects.tool import ToolCompliance, ToolOffset, ToolRadius
from palpate.setup.setup import Setup, Shape

__all__ = ["FELT", "FELT_IN_A_BLOCK", "weighed"]

FELT: tuple[type[Effect], ...] = (
    PoissonRatio,
    StiffInclusion,
    ToolRadius,
    ToolOffset,
    StiffnessGradient,
    StrainStiffening,
    Anisotropy,
    BaseCompliance,
    ToolCompliance,
)
"""Effects that forces alone can tell, of a body of any shape."""
FELT_IN_A_BLOCK: tuple[type[Effect], ...] = (SurfaceLayer,)
"""Those that need a block's flat top besides."""


def weighed(setup: Setup, *, seen: bool, forces: bool) -> tuple[type[Effect], ...]:
    """The effects to weigh, in the catalogue's order, the modulus last.

    Args:
        seen: whether any sequence has clouds.
        forces: whether any has forces.
    """
    modulus: tuple[type[Effect], ...] = (YoungModulus,) if forces else ()
    if seen:
        return (*DIAGNOSED, *modulus)
    felt = FELT if isinstance(setup.geometry, Shape) else (*FELT, *FELT_IN_A_BLOCK)
    return (*(kind for kind in DIAGNOSED if kind in felt), *modulus)
