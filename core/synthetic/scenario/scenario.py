"""Scenarios of virtual experiments: stated beliefs and hidden effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from palpate.synthetic.nuisances import Nuisance
from palpate.synthetic.scenario.disturbance import Disturbance
from palpate.synthetic.scenario.hidden_effects import HiddenEffect

__all__ = ["SHORT_PROTOCOL", "STRAYED", "Scenario"]

STRAYED = 4e-3
"""Offset of a block from its place beyond which any operator puts it back [m]."""

SHORT_PROTOCOL = ("poke-top-01", "poke-top-02", "poke-side-01", "poke-side-02", "drag-01")
"""Every kind of motion for the fit, and for the test a push from another side, which shows most
causes."""


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Stated beliefs, hidden effects, and sampling of the sensors.

    Attributes:
        effects: hidden, known to nobody.
        disturbances: hidden, outside the catalogue of effects.
        nuisances: faults of the bench for which nothing is to be named.
        declared_filters: names of the filters that the dataset states.
        sequences: names; the part before the number is the kind of motion: poke-top, poke-side or
            drag.
        rounds: number of rounds (three pushes, or one drag) by sequence; one by default.
        splits: names of the sequences of train, validation and test; by their kinds if empty.
        size: believed size of the block [m].
        mass: [kg].
        young_modulus: believed, and true unless another one is hidden [Pa].
        poisson_ratio: believed [1].
        tool_radius: believed [m].
        touch_offset: tool centre above the landmark at touch [m].
        density: approximate number of points on the phantom in one cloud.
        rate: clouds per second [1/s].
        robot_rate: tool poses per second [1/s].
        noise: standard deviation of a depth at 0.35 m [m].
        fine: longest element edge at the contact [m].
        force_noise: standard deviation of one sample of the force on the tool [N]; None without a
            force sensor.
        put_back: whether a block that slid is put back before the next sequence; otherwise it stays
            where it is, up to STRAYED.
    """

    effects: tuple[HiddenEffect, ...] = ()
    disturbances: tuple[Disturbance, ...] = ()
    nuisances: tuple[Nuisance, ...] = ()
    declared_filters: tuple[str, ...] = ()
    sequences: tuple[str, ...] = (
        "poke-top-01",
        "poke-top-02",
        "poke-top-03",
        "poke-side-01",
        "poke-side-02",
        "drag-01",
        "drag-02",
    )
    rounds: Mapping[str, int] = field(default_factory=dict)
    splits: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    size: tuple[float, float, float] = (0.0687, 0.0393, 0.0358)
    mass: float = 0.10401
    young_modulus: float = 5.0e3
    poisson_ratio: float = 0.45
    tool_radius: float = 0.005
    touch_offset: float = 0.005
    density: int = 2600
    rate: float = 3.75
    robot_rate: float = 1000.0
    noise: float = 0.7e-3
    fine: float = 2.6e-3
    force_noise: float | None = None
    put_back: bool = True

    @property
    def true_size(self) -> tuple[float, float, float]:
        """True size of the block [m]."""
        hidden, (x, y, z) = self.hidden("geometry_scale"), self.size
        return (
            (hidden.value("scale_x") * x, hidden.value("scale_y") * y, hidden.value("scale_z") * z)
            if hidden
            else self.size
        )

    def hidden(self, effect: str) -> HiddenEffect | None:
        """The effect of that name, if it is hidden here."""
        return next((hidden for hidden in self.effects if hidden.effect == effect), None)

    def disturbance(self, name: str) -> Disturbance | None:
        """The disturbance of that name, if there is one here."""
        return next((one for one in self.disturbances if one.name == name), None)

    @property
    def has_history(self) -> bool:
        """Whether the material has internal variables."""
        return any(self.hidden(name) for name in ("viscoelasticity", "permanent_set"))

    @property
    def true_modulus(self) -> float:
        """True Young's modulus of the block [Pa]."""
        hidden = self.hidden("young_modulus")
        return hidden.value("E") if hidden else self.young_modulus
