"""What the experimenter believes, as one frozen description. An effect replaces a part of it; the solver reads nothing else."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from core.bounds import within as _within
from core.box import Box
from core.errors import SetupError
from core.frames import Transform
from core.shape.body import Shape

__all__ = [
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
]

MaterialLaw = Literal["neo_hooke", "corotational"]
Edge = Literal["-x", "+x", "-y", "+y"]


@dataclass(frozen=True, kw_only=True)
class Inclusion:
    """A ball of other stiffness: centre in the phantom frame [m], radius [m], stiffness of lump over rest [1]."""

    x: float
    y: float
    z: float
    radius: float
    stiffness_ratio: float


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A skin of other stiffness on the top: thickness [m], stiffness of skin over rest [1]."""

    thickness: float
    stiffness_ratio: float

    def __post_init__(self) -> None:
        _within("layer thickness", self.thickness, 1e-5, 2.0, "m")
        _within("layer stiffness_ratio", self.stiffness_ratio, 1e-3, 1e3, "")


@dataclass(frozen=True, kw_only=True)
class Fibres:
    """Stiffer along one direction in the plane: its angle from the x axis [rad], E along over E across [1]."""

    direction: float
    stiffness_ratio: float

    def __post_init__(self) -> None:
        _within("fibres stiffness_ratio", self.stiffness_ratio, 1.0, 1e3, "")


@dataclass(frozen=True, kw_only=True)
class Relaxation:
    """One term of a Prony series: the share of the shear modulus that relaxes [1], and its time constant [s]."""

    fraction: float
    time_constant: float

    def __post_init__(self) -> None:
        _within("relaxation fraction", self.fraction, 0.0, 1.0, "")
        _within("relaxation time_constant", self.time_constant, 1e-6, 1e9, "s")


@dataclass(frozen=True, kw_only=True)
class Material:
    """What the block is made of.

    Attributes:
        young_modulus: at rest [Pa]; of a material that relaxes, that of a motion faster than it does. poisson_ratio: likewise [1].
        law: of elasticity. inclusions: lumps inside. layer: a skin on the top.
        log_ratio: ln of Young's modulus at the top over that at the base, its geometric mean kept [1].
        stretch_limit: J_m of Gent's law [1], where the material is stretched to its limit; None for a material without.
        fibres: along one direction; None for a material that is the same in all.
        relaxation: terms of a Prony series, whose fractions add up to less than one. retained_fraction: of the largest strain
            that stays when the load is gone [1]. Both as `core.memory` has them.
    """

    young_modulus: float = 5.0e3
    poisson_ratio: float = 0.45
    law: MaterialLaw = "neo_hooke"
    inclusions: tuple[Inclusion, ...] = ()
    layer: Layer | None = None
    log_ratio: float = 0.0
    stretch_limit: float | None = None
    fibres: Fibres | None = None
    relaxation: tuple[Relaxation, ...] = ()
    retained_fraction: float = 0.0

    def __post_init__(self) -> None:
        _within("young_modulus", self.young_modulus, 1.0, 1e9, "Pa")
        _within("poisson_ratio", self.poisson_ratio, -0.5, 0.4999, "")
        _within("log_ratio", self.log_ratio, -7.0, 7.0, "")
        if self.stretch_limit is not None:
            _within("stretch_limit", self.stretch_limit, 0.1, 1e6, "")
            if self.law == "corotational":
                raise SetupError("the corotational law has no stretch_limit; use neo_hooke with it", key="stretch_limit")
        _within("relaxed fractions in all", sum(term.fraction for term in self.relaxation), 0.0, 0.99, "")
        _within("retained_fraction", self.retained_fraction, 0.0, 0.9, "")
        if self.remembers and self.law == "corotational":
            key = "relaxation" if self.relaxation else "retained_fraction"
            raise SetupError(f"the corotational law has no {key}; use neo_hooke with it", key=key)

    @property
    def remembers(self) -> bool:
        """Whether its stress depends on what was done to it before."""
        return bool(self.relaxation or self.retained_fraction)


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
        friction_coefficient: of a base that slides as a whole, Coulomb's [1]; None for one that does not.
        detached: strips that are not held. stiffness_over_E: springs per area under the base, in all directions, over Young's
            modulus [1/m]; None for a rigid support.
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
        radius: [m]. offset: where its centre is against the stated one before anything is touched, phantom frame [m].
        compliance_times_stiffness: how far the force F on it moves its centre, C F: C times Young's modulus [1/m].
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
        camera_shift: where the camera registration is off: true phantom_from_camera = camera_shift @ stated one.
    """

    depth_sigma: float = 0.002
    time_offset: float = 0.0
    camera_shift: Transform = field(default_factory=Transform)


@dataclass(frozen=True, kw_only=True)
class Setup:
    """One experiment as believed: geometry, material, load, support, tool, sensor and registrations.

    Attributes:
        mass: of the phantom [kg].
        landmarks: (x, y, z) [m] of the points whose touches gave phantom_from_robot; they sag with the block.
        phantom_from_robot, phantom_from_camera: the stated registrations.
    """

    geometry: Box | Shape
    tool: Tool
    material: Material = field(default_factory=Material)
    load: Load = field(default_factory=Load)
    support: Support = field(default_factory=Support)
    sensor: Sensor = field(default_factory=Sensor)
    mass: float = 0.1
    landmarks: tuple[tuple[float, float, float], ...] = ()
    phantom_from_robot: Transform = field(default_factory=Transform)
    phantom_from_camera: Transform = field(default_factory=Transform)

    def __post_init__(self) -> None:
        if isinstance(self.geometry, Shape):
            self._check_shape(self.geometry)

    def _check_shape(self, shape: Shape) -> None:
        """What is said of a block's flat sides makes no sense of every shape."""
        if self.material.layer is not None:
            raise SetupError(f"{shape.name}: a layer lies on the flat top of a block; leave it out for other shapes", key="layer")
        if self.support.detached and not shape.flat_base:
            raise SetupError(
                f"{shape.name}: only a base that lies in z = 0 can be detached; what is held here reaches from "
                f"{shape.corners[shape.held][..., 2].min():.4g} to {shape.corners[shape.held][..., 2].max():.4g} m", key="detached",
            )  # fmt: skip

    @property
    def box(self) -> Box:
        """The geometry of a block; SetupError for other shapes."""
        if isinstance(self.geometry, Shape):
            raise SetupError(f"{self.geometry.name}: this works for a block only, not for other shapes yet", key="geometry")
        return self.geometry

    @property
    def shape(self) -> Shape:
        """The geometry of a body that is no block; SetupError for a block."""
        if isinstance(self.geometry, Box):
            raise SetupError("tetrahedra fill closed surfaces; mesh a block with a grid of hexahedra", key="geometry")
        return self.geometry

    @property
    def remembers(self) -> bool:
        """Whether a frame depends on all those before it, so that none may be left out."""
        return bool(self.tool.friction_coefficient) or self.material.remembers

    @property
    def phantom_from_camera_true(self) -> Transform:
        """The camera registration including the sensor's believed shift."""
        return self.sensor.camera_shift @ self.phantom_from_camera

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, SI units."""
        return {
            "geometry": self.geometry.as_dict(),
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
            },
            "mass": self.mass,
            "phantom_from_robot": self.phantom_from_robot.matrix.tolist(),
            "phantom_from_camera": self.phantom_from_camera.matrix.tolist(),
        }
