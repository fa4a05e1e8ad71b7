"""Stated values that no soft phantom and no tool for it have, most often for a wrong unit."""

from __future__ import annotations

import numpy as np

from palpate.dataset.check.landmark_places import off_surface
from palpate.dataset.schema import DatasetConfig
from palpate.setup.phantom_geometry import Geometry

__all__ = ["frame_notes", "implausible_values"]

DENSITY = 300.0, 3000.0
"""Least and largest density [kg/m^3]: foams have 300, gels, silicone and tissue 900 to 1400, filled
rubber up to 2500."""
MODULUS = 100.0, 2e6
"""Least and largest Young's modulus [Pa]: brain and fat have hundreds of pascals, cartilage and
firm silicone a megapascal."""
OFFSET = 3.0
"""Largest height of the tool's centre at a touch [radii of the tool]."""
DEEPEST = 0.8
"""Largest diameter of the tool over the phantom's smallest extent [1]: a larger ball meets the
support before it dents the phantom as it dents a thick one."""


def implausible_values(config: DatasetConfig, body: Geometry) -> list[str]:
    """Return a sentence with the value, its bound and the reason for each implausible value.

    Args:
        config: of the dataset.
        body: the phantom.
    """
    volume, modulus = body.volume, config.young_modulus
    density = config.mass / volume
    smallest, diameter = min(body.size), 2 * config.tool_radius
    doubts = []
    if not DENSITY[0] <= density <= DENSITY[1]:
        doubts.append(
            f"phantom.mass = {config.mass:g} kg on {1e6 * volume:.3g} cm3 is {density:.3g} kg/m3; "
            f"soft phantoms have {DENSITY[0]:g} to {DENSITY[1]:g} kg/m3: is it in kilograms?"
        )
    if not MODULUS[0] <= modulus <= MODULUS[1]:
        doubts.append(
            f"phantom.young_modulus = {modulus:g} Pa; soft phantoms have {MODULUS[0]:g} to "
            f"{MODULUS[1]:g} Pa: is it in pascals?"
        )
    if diameter > DEEPEST * smallest:
        doubts.append(
            f"tool.radius = {1e3 * config.tool_radius:g} mm makes a ball of {1e3 * diameter:g} mm "
            f"for a phantom of {1e3 * smallest:.3g} mm; at most {DEEPEST:g} of it is expected, "
            "since a larger ball feels the support: is it the radius, in metres?"
        )
    if abs(config.touch_offset) > OFFSET * config.tool_radius:
        doubts.append(
            f"landmarks.touch_offset = {1e3 * config.touch_offset:g} mm; the centre of a ball of "
            f"{1e3 * config.tool_radius:g} mm radius that touches a landmark is within "
            f"{OFFSET:g} radii of it: is it the height of the ball's centre, in metres?"
        )
    doubts += off_surface(config, body)
    return doubts


def frame_notes(config: DatasetConfig) -> list[str]:
    """Return a sentence where the phantom was turned or lifted to stand upright on z = 0."""
    turn = config.phantom_from_file
    if np.array_equal(turn.matrix, np.eye(4)):
        return []
    angle = float(np.degrees(np.linalg.norm(turn.rotation_vector)))
    lift = 1e3 * float(turn.translation[2])
    return [
        f"the surface is turned by {angle:.1f} degrees and lifted by {lift:.1f} mm, so that up is "
        "z and its lowest point lies in z = 0: places in results are in that frame, to which "
        "phantom_from_file leads from the frame of the files"
    ]
