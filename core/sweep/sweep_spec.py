"""What is asked of a sweep, as plain values that REST, terminal and records share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from palpate.foundation.errors import SetupError
from palpate.sweep.parameter_space import Axis, ParameterSpace

__all__ = ["METHODS", "MOST_POINTS", "Measure", "Method", "SweepSpec"]

Method = Literal["grid", "random", "tpe", "cmaes"]
Measure = Literal["distance", "paper"]
METHODS: tuple[str, ...] = get_args(Method)
MOST_POINTS = 20000


@dataclass(frozen=True, kw_only=True)
class SweepSpec:
    """One sweep.

    Attributes:
        space: what is moved.
        method: grid (coarse to fine), random, TPE or CMA-ES.
        steps: of a grid along each axis.
        levels: of a grid: each spans one step to both sides of the best point before.
        points: of the other methods.
        sequences: which; all with clouds where none is named.
        frames: touched clouds of each, evenly spread.
        measure: of the error: RMS of patch averages of signed distance, or the paper's mean
            distance.
        seed: of all draws.
    """

    space: ParameterSpace
    method: Method = "grid"
    steps: int = 7
    levels: int = 1
    points: int = 40
    sequences: tuple[str, ...] = ()
    frames: int = 8
    measure: Measure = "distance"
    seed: int = 0

    def __post_init__(self) -> None:
        _one_of("method", self.method, METHODS)
        _one_of("measure", self.measure, get_args(Measure))
        for key, low, high in (
            ("steps", 2, 1000),
            ("levels", 1, 12),
            ("points", 1, MOST_POINTS),
            ("frames", 1, 1000),
        ):
            value = getattr(self, key)
            if not low <= value <= high:
                raise SetupError(
                    f"{key} = {value}; expected {low} to {high}",
                    key=key,
                    value=value,
                    low=low,
                    high=high,
                )
        if self.method == "grid" and self.planned > MOST_POINTS:
            text = f"a grid of {self.planned} points; expected at most {MOST_POINTS}: take fewer steps, or random, tpe or cmaes"
            raise SetupError(text, key="steps", value=self.steps)
        if self.method == "cmaes" and len(self.space.axes) < 2:
            raise SetupError(
                "CMA-ES moves two parameters or more; take tpe or grid for one",
                key="method",
                value="cmaes",
            )

    @property
    def planned(self) -> int:
        """Points that the method itself asks for."""
        return (
            self.levels * self.steps ** len(self.space.axes)
            if self.method == "grid"
            else self.points
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        plain = {
            key: getattr(self, key)
            for key in ("method", "steps", "levels", "points", "frames", "measure", "seed")
        }
        axes = [
            {"parameter": axis.name, "low": axis.low, "high": axis.high} for axis in self.space.axes
        ]
        return {
            "parameters": axes,
            "fixed": dict(self.space.fixed),
            "sequences": list(self.sequences),
            **plain,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> SweepSpec:
        """The inverse; what is left out has its default."""
        axes = tuple(
            Axis(one["parameter"], float(one["low"]), float(one["high"]))
            for one in data["parameters"]
        )
        plain = {
            key: data[key]
            for key in ("method", "steps", "levels", "points", "frames", "measure", "seed")
            if key in data
        }
        return cls(
            space=ParameterSpace(axes, dict(data.get("fixed", {}))),
            sequences=tuple(data.get("sequences", ())),
            **plain,
        )


def _one_of(key: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise SetupError(
            f"{key} = {value!r}; expected one of {', '.join(known)}", key=key, value=value
        )
