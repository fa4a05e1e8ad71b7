"""The experiment as assumed, in one frozen description.

An effect replaces a part of it; the solver reads nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.foundation.frames import Transform
from palpate.setup.bounds import TOOL_RADII, require_within
from palpate.setup.box import Box
from palpate.setup.free_form.cast_modes import cast_modes, check_cast
from palpate.setup.free_form.cast_surface import CastSurface
from palpate.setup.free_form.shape import Shape
from palpate.setup.landmark_touches import PAIRINGS, Touching, Tracing
from palpate.setup.material import (
    AnyInclusion,
    Fibres,
    Inclusion,
    Layer,
    Material,
    MaterialLaw,
    Point,
    Relaxation,
    Tube,
)
from palpate.setup.phantom_geometry import LEAST_EDGE, PATCH, SPACING, Surface

__all__ = [
    "PAIRINGS",
    "AnyInclusion",
    "Box",
    "Detachment",
    "Edge",
    "Fibres",
    "Inclusion",
    "Layer",
    "Load",
    "Material",
    "MaterialLaw",
    "Point",
    "Relaxation",
    "Sensor",
    "Setup",
    "Shape",
    "Support",
    "Tool",
    "Touching",
    "Tracing",
    "Tube",
]

Edge = Literal["-x", "+x", "-y", "+y"]


@dataclass(frozen=True, kw_only=True)
class Load:
    """Gravity.

    Attributes:
        specific_weight_over_stiffness: weight per volume over Young's modulus, rho g / E [1/m];
            zero leaves gravity out.
    """

    specific_weight_over_stiffness: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Detachment:
    """A strip of the base along one edge that is not held.

    Attributes:
        edge: of the base.
        extent: width of the strip, inwards from the edge [m].
    """

    edge: Edge
    extent: float


@dataclass(frozen=True, kw_only=True)
class Support:
    """The support of the base.

    Attributes:
        friction_coefficient: Coulomb coefficient of a base that can slip as a whole [1]; None for a
            base that cannot.
        detached: strips that are not held.
        stiffness_over_E: stiffness of springs under the base, per area and in all directions, over
            Young's modulus [1/m]; None for a rigid support.
    """

    friction_coefficient: float | None = None
    detached: tuple[Detachment, ...] = ()
    stiffness_over_E: float | None = None

    def __post_init__(self) -> None:
        if self.stiffness_over_E is not None:
            require_within("support stiffness_over_E", self.stiffness_over_E, 1e-2, 1e6, "1/m")


@dataclass(frozen=True, kw_only=True)
class Tool:
    """A rigid sphere.

    Attributes:
        radius: [m].
        offset: true minus stated position of its centre without load, phantom frame [m].
        compliance_times_stiffness: compliance C of its mount times Young's modulus [1/m]; the force
            F on the tool moves its centre by C F.
        friction_coefficient: Coulomb coefficient of the tool on the surface [1].
    """

    radius: float
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    compliance_times_stiffness: float = 0.0
    friction_coefficient: float = 0.0

    def __post_init__(self) -> None:
        require_within("tool radius", self.radius, *TOOL_RADII, "m")
        require_within(
            "tool compliance_times_stiffness", self.compliance_times_stiffness, 0.0, 1e3, "1/m"
        )
        require_within("tool friction_coefficient", self.friction_coefficient, 0.0, 10.0, "")


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """The depth camera.

    Attributes:
        depth_sigma: the maker's stated accuracy [m].
        time_offset: cloud stamp minus robot stamp of the same instant [s].
        camera_shift: error of the camera registration: true phantom_from_camera = camera_shift @
            stated one.
        depth_offset: b in the reading a z + b of a depth z along the camera's axis [m].
        depth_scale: a in the same [1].
        edge: width of the band along the phantom's edges in which filters round depth [m]; points
            there are not compared.
        view: (x/z, y/z) of the corners of the convex part of the image that the camera sees, camera
            frame; empty for all of it.
    """

    depth_sigma: float = 0.002
    time_offset: float = 0.0
    camera_shift: Transform = field(default_factory=Transform)
    depth_offset: float = 0.0
    depth_scale: float = 1.0
    edge: float = 0.0
    view: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        require_within("sensor depth_offset", self.depth_offset, -0.2, 0.2, "m")
        require_within("sensor depth_scale", self.depth_scale, 0.5, 2.0, "")


@dataclass(frozen=True, kw_only=True)
class Setup:
    """One experiment as assumed.

    Attributes:
        geometry: of the body.
        tool: the sphere that pushes.
        material: of the body.
        load: gravity.
        support: of the base.
        sensor: the depth camera.
        mass: of the phantom [kg].
        registered: the body that the registrations assumed; None if that is `geometry`.
        landmarks: (x, y, z) [m] of the points whose touches gave phantom_from_robot, on the
            registered block; they sag with it.
        touching: how the landmarks were touched.
        tracing: the traces by which the robot was registered; None unless it was by traces.
        phantom_from_robot: the stated registration of the robot.
        phantom_from_camera: the stated registration of the camera.
        cast: factors of the modes of `palpate.setup.free_form.cast_modes` [m], by which the cast of
            a free form is offset from the stated surface; empty for none.
        element_size: edge length of the even grid that replaces any other mesh of a replay [m];
            None for none.
    """

    geometry: Box | Shape
    tool: Tool
    material: Material = field(default_factory=Material)
    load: Load = field(default_factory=Load)
    support: Support = field(default_factory=Support)
    sensor: Sensor = field(default_factory=Sensor)
    mass: float = 0.1
    registered: Box | Shape | None = None
    landmarks: tuple[tuple[float, float, float], ...] = ()
    touching: Touching = field(default_factory=Touching)
    tracing: Tracing | None = None
    phantom_from_robot: Transform = field(default_factory=Transform)
    phantom_from_camera: Transform = field(default_factory=Transform)
    cast: tuple[float, ...] = ()
    element_size: float | None = None

    def __post_init__(self) -> None:
        if self.element_size is not None:
            require_within("element_size", self.element_size, 5e-4, 1.0, "m")
        if self.touching.misses and len(self.touching.misses) != len(self.landmarks):
            message = (
                f"{len(self.touching.misses)} touches miss {len(self.landmarks)} landmarks; "
                "state one miss for each"
            )
            raise SetupError(message, key="misses")
        if isinstance(self.geometry, Shape):
            self._check_shape(self.geometry)
        check_cast(self.cast, self.geometry.is_block)

    def _check_shape(self, shape: Shape) -> None:
        """Refuse a detached part of a base that is not flat."""
        if self.support.detached and not shape.flat_base:
            heights = shape.corners[shape.held][..., 2]
            raise SetupError(
                f"{shape.name}: only a base that lies in z = 0 can be detached; what is held here "
                f"reaches from {heights.min():.4g} to {heights.max():.4g} m",
                key="detached",
            )

    @property
    def stated_geometry(self) -> Box | Shape:
        """The geometry that the registrations assumed."""
        return self.registered or self.geometry

    @property
    def scale(self) -> FloatArray:
        """True over stated lengths of the body along x, y, z (3,) [1]."""
        return (
            np.ones(3)
            if self.registered is None
            else np.array(self.geometry.size) / np.array(self.registered.size)
        )

    @property
    def factors(self) -> tuple[float, float, float]:
        """`scale` as a tuple, for keys of caches."""
        x, y, z = (float(factor) for factor in self.scale)
        return x, y, z

    @property
    def stated_shape(self) -> Shape:
        """The stated geometry of a body that is not a block; SetupError for a block."""
        if isinstance(self.stated_geometry, Box):
            raise SetupError(
                "tetrahedra fill closed surfaces; mesh a block with a grid of hexahedra",
                key="geometry",
            )
        return self.stated_geometry

    def surface(self, spacing: float = SPACING, patch: float = PATCH) -> Surface:
        """The free surface of the body, see `Geometry.surface`."""
        edge = max(LEAST_EDGE, self.sensor.edge)
        under = self.geometry.surface(spacing, patch, self.registered, edge)
        if not self.cast:
            return under
        return CastSurface(under, cast_modes(self.stated_shape), self.cast)

    def cast_motion(self, places: FloatArray) -> FloatArray:
        """Motion (m, 3) [m] from places (m, 3) [m] of the stated free surface to those of the cast,
        without another size of the body.
        """
        if not self.cast:
            return np.zeros_like(places)
        return cast_modes(self.stated_shape).motion(self.cast, places)

    @property
    def largest_offset(self) -> float:
        """Largest offset of the cast from the stated surface, either way [m]."""
        return cast_modes(self.stated_shape).largest(self.cast) if self.cast else 0.0

    @property
    def has_history(self) -> bool:
        """Whether a frame depends on all those before it, so that none may be left out."""
        return bool(self.tool.friction_coefficient) or self.material.has_history

    @property
    def pushes_leave_traces(self) -> bool:
        """Whether a push has an effect after the tool is gone.

        Either a material with history keeps a dent, or the block has slipped.
        """
        return self.support.friction_coefficient is not None or self.material.has_history

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, SI units."""
        return {
            "geometry": self.geometry.as_dict(),
            "registered": None if self.registered is None else self.registered.as_dict(),
            "material": {
                "law": self.material.law,
                "young_modulus": self.material.young_modulus,
                "poisson_ratio": self.material.poisson_ratio,
                "stretch_limit": self.material.stretch_limit,
                **self.material.listed_inclusions,
                "layer": None if self.material.layer is None else vars(self.material.layer),
                "log_ratio": self.material.log_ratio,
                "fibres": None if self.material.fibres is None else vars(self.material.fibres),
                "relaxation": [vars(term) for term in self.material.relaxation],
                "retained_fraction": self.material.retained_fraction,
            },
            "load": {"specific_weight_over_stiffness": self.load.specific_weight_over_stiffness},
            "support": {
                "friction_coefficient": self.support.friction_coefficient,
                "detached": [vars(strip) for strip in self.support.detached],
                "stiffness_over_E": self.support.stiffness_over_E,
            },
            "tool": {
                "radius": self.tool.radius,
                "offset": list(self.tool.offset),
                "compliance_times_stiffness": self.tool.compliance_times_stiffness,
                "friction_coefficient": self.tool.friction_coefficient,
            },
            "sensor": {
                "depth_sigma": self.sensor.depth_sigma,
                "time_offset": self.sensor.time_offset,
                "camera_shift": self.sensor.camera_shift.matrix.tolist(),
                "depth_offset": self.sensor.depth_offset,
                "depth_scale": self.sensor.depth_scale,
                # Left out without one: setups stored before there was one have none.
                **{
                    key: value
                    for key, value in (("edge", self.sensor.edge), ("view", self.sensor.view))
                    if value
                },
            },
            "landmarks": [list(place) for place in self.landmarks],
            "touching": self.touching.as_dict(),
            **({} if self.tracing is None else {"tracing": vars(self.tracing)}),
            **({"cast": list(self.cast)} if self.cast else {}),
            "element_size": self.element_size,
            "mass": self.mass,
            "phantom_from_robot": self.phantom_from_robot.matrix.tolist(),
            "phantom_from_camera": self.phantom_from_camera.matrix.tolist(),
        }
