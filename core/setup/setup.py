"""What the experimenter believes, as one frozen description. An effect replaces a part of it; the
solver reads nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.foundation.frames import Transform
from palpate.setup.bounds import within as _within
from palpate.setup.box import Box
from palpate.setup.material import Fibres, Inclusion, Layer, Material, MaterialLaw, Relaxation
from palpate.setup.shape import Shape

__all__ = [
    "PAIRINGS",
    "Box",
    "Detachment",
    "Edge",
    "Fibres",
    "Inclusion",
    "Layer",
    "Load",
    "Material",
    "MaterialLaw",
    "Relaxation",
    "Sensor",
    "Setup",
    "Shape",
    "Support",
    "Tool",
    "Touching",
]

Edge = Literal["-x", "+x", "-y", "+y"]
PAIRINGS = (
    "as-paired",
    "swap-1-2",
    "swap-1-3",
    "swap-1-4",
    "swap-2-3",
    "swap-2-4",
    "swap-3-4",
    "turn-1",
    "turn-2",
    "turn-3",
    "reversed",
)
"""How touches can really be paired with landmarks: as stated, two rows of touches.csv for each
other, or each with the landmark of the row so many further on, after the last with the first, or
all in the reverse order."""


@dataclass(frozen=True, kw_only=True)
class Load:
    """Own weight per volume over Young's modulus, rho g / E [1/m]; zero leaves gravity out."""

    specific_weight_over_stiffness: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Detachment:
    """A strip of the base along one edge that is not held, `extent` inwards from it [m]."""

    edge: Edge
    extent: float


@dataclass(frozen=True, kw_only=True)
class Support:
    """How the base is held.

    Attributes:
        friction_coefficient: of a base that slides as a whole, Coulomb's [1]; None for one that
            does not.
        detached: strips that are not held.
        stiffness_over_E: springs per area under the base, in all directions, over Young's modulus
            [1/m]; None for a rigid support.
    """

    friction_coefficient: float | None = None
    detached: tuple[Detachment, ...] = ()
    stiffness_over_E: float | None = None

    def __post_init__(self) -> None:
        if self.stiffness_over_E is not None:
            _within("support stiffness_over_E", self.stiffness_over_E, 1e-2, 1e6, "1/m")


@dataclass(frozen=True, kw_only=True)
class Tool:
    """A rigid sphere.

    Attributes:
        radius: [m].
        offset: where its centre is against the stated one before anything is touched, phantom frame
            [m].
        compliance_times_stiffness: how far the force F on it moves its centre, C F: C times Young's
            modulus [1/m].
        friction_coefficient: Coulomb's, of the tool on the surface [1].
    """

    radius: float
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    compliance_times_stiffness: float = 0.0
    friction_coefficient: float = 0.0

    def __post_init__(self) -> None:
        _within("tool radius", self.radius, 1e-4, 0.2, "m")
        _within("tool compliance_times_stiffness", self.compliance_times_stiffness, 0.0, 1e3, "1/m")
        _within("tool friction_coefficient", self.friction_coefficient, 0.0, 10.0, "")


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """The depth camera.

    Attributes:
        depth_sigma: the maker's stated accuracy [m].
        time_offset: cloud stamp minus robot stamp of the same instant [s].
        depth_offset, depth_scale: what it reads of a depth z along its axis: depth_scale z +
            depth_offset [m], [1].
        camera_shift: where the camera registration is off: true phantom_from_camera = camera_shift
            @ stated one.
    """

    depth_sigma: float = 0.002
    time_offset: float = 0.0
    camera_shift: Transform = field(default_factory=Transform)
    depth_offset: float = 0.0
    depth_scale: float = 1.0

    def __post_init__(self) -> None:
        _within("sensor depth_offset", self.depth_offset, -0.2, 0.2, "m")
        _within("sensor depth_scale", self.depth_scale, 0.5, 2.0, "")


@dataclass(frozen=True, kw_only=True)
class Touching:
    """How the landmarks were touched, which gave phantom_from_robot.

    Attributes:
        misses: (x, y, z) [m] of each moved touch minus its landmark under the stated registration,
            phantom frame; none were any.
        lift: height of the tool's centre over the landmark at a touch [m].
        pairing: which landmark each touch was really of, one of PAIRINGS.
        scale: of the touched polygon over that of the landmarks [1].
        inset: how far inside each touch was made, along x and along y [m]: a ball does not stay on
            a corner.
    """

    misses: tuple[tuple[float, float, float], ...] = ()
    lift: float = 0.0
    pairing: str = "as-paired"
    scale: float = 1.0
    inset: float = 0.0

    def __post_init__(self) -> None:
        if self.pairing not in PAIRINGS:
            raise SetupError(
                f"pairing = {self.pairing!r} is none of {', '.join(PAIRINGS)}",
                key="pairing",
                value=self.pairing,
            )
        _within("touching scale", self.scale, 0.1, 10.0, "")

    def order(self, count: int) -> list[int]:
        """The landmark, by its row, that each of `count` touches was really of; SetupError where
        there are too few.
        """
        order, (kind, *words) = list(range(count)), self.pairing.split("-")
        if kind == "as":
            return order
        if kind == "reversed":
            return order[::-1]
        rows = [int(word) for word in words]
        if max(rows) > count - (kind == "turn"):
            raise SetupError(
                f"pairing {self.pairing!r} needs more than {count} touches",
                key="pairing",
                value=self.pairing,
            )
        if kind == "turn":
            return order[rows[0] :] + order[: rows[0]]
        first, second = (row - 1 for row in rows)
        order[first], order[second] = second, first
        return order


@dataclass(frozen=True, kw_only=True)
class Setup:
    """One experiment as believed: geometry, material, load, support, tool, sensor and
    registrations.

    Attributes:
        mass: of the phantom [kg].
        geometry: of the body.
        registered: what the registrations took it for; None where that is `geometry`.
        landmarks: (x, y, z) [m] of the points whose touches gave phantom_from_robot, on what was
            registered; they sag with the block.
        touching: how they were touched.
        phantom_from_robot, phantom_from_camera: the stated registrations.
        element_size: edges of the even grid that replaces whatever a replay is meshed with [m];
            None for none.
    """

    geometry: Box | Shape
    tool: Tool
    material: Material = field(default_factory=Material)
    load: Load = field(default_factory=Load)
    support: Support = field(default_factory=Support)
    sensor: Sensor = field(default_factory=Sensor)
    mass: float = 0.1
    registered: Box | None = None
    landmarks: tuple[tuple[float, float, float], ...] = ()
    touching: Touching = field(default_factory=Touching)
    phantom_from_robot: Transform = field(default_factory=Transform)
    phantom_from_camera: Transform = field(default_factory=Transform)
    element_size: float | None = None

    def __post_init__(self) -> None:
        if self.element_size is not None:
            _within("element_size", self.element_size, 5e-4, 1.0, "m")
        if self.touching.misses and len(self.touching.misses) != len(self.landmarks):
            told = f"{len(self.touching.misses)} touches miss {len(self.landmarks)} landmarks; state one miss for each"
            raise SetupError(told, key="misses")
        if isinstance(self.geometry, Shape):
            self._check_shape(self.geometry)

    def _check_shape(self, shape: Shape) -> None:
        """What is said of a block's flat sides makes no sense of every shape."""
        if self.material.layer is not None:
            raise SetupError(
                f"{shape.name}: a layer lies on the flat top of a block; leave it out for other shapes",
                key="layer",
            )
        if self.support.detached and not shape.flat_base:
            raise SetupError(
                f"{shape.name}: only a base that lies in z = 0 can be detached; what is held here reaches from "
                f"{shape.corners[shape.held][..., 2].min():.4g} to {shape.corners[shape.held][..., 2].max():.4g} m",
                key="detached",
            )

    @property
    def box(self) -> Box:
        """The geometry of a block; SetupError for other shapes."""
        if isinstance(self.geometry, Shape):
            raise SetupError(
                f"{self.geometry.name}: this works for a block only, not for other shapes yet",
                key="geometry",
            )
        return self.geometry

    @property
    def stated_geometry(self) -> Box | Shape:
        """What the registrations took the geometry for."""
        return self.registered or self.geometry

    @property
    def stated_box(self) -> Box:
        """The same of a block; SetupError for other shapes."""
        return self.registered or self.box

    @property
    def scale(self) -> FloatArray:
        """True over stated lengths of the block along x, y, z (3,) [1]."""
        return (
            np.ones(3)
            if self.registered is None
            else np.array(self.box.size) / np.array(self.registered.size)
        )

    @property
    def shape(self) -> Shape:
        """The geometry of a body that is no block; SetupError for a block."""
        if isinstance(self.geometry, Box):
            raise SetupError(
                "tetrahedra fill closed surfaces; mesh a block with a grid of hexahedra",
                key="geometry",
            )
        return self.geometry

    @property
    def has_history(self) -> bool:
        """Whether a frame depends on all those before it, so that none may be left out."""
        return bool(self.tool.friction_coefficient) or self.material.has_history

    @property
    def pushes_leave_traces(self) -> bool:
        """Whether a push leaves something when the tool is gone: a dent in a material that
        remembers, or a block that slid.
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
                "inclusions": [vars(lump) for lump in self.material.inclusions],
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
            },
            "landmarks": [list(place) for place in self.landmarks],
            "touching": {
                **vars(self.touching),
                "misses": [list(miss) for miss in self.touching.misses],
            },
            "element_size": self.element_size,
            "mass": self.mass,
            "phantom_from_robot": self.phantom_from_robot.matrix.tolist(),
            "phantom_from_camera": self.phantom_from_camera.matrix.tolist(),
        }
