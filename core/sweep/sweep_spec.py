"""The specification of a sweep, as plain values that REST, command line and records share."""

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
"""Most points of a sweep."""


@dataclass(frozen=True, kw_only=True)
class SweepSpec:
    """The specification of one sweep.

    Attributes:
        space: the swept parameters and the fixed ones.
        method: grid (coarse to fine), random, TPE or CMA-ES.
        steps: points of a grid along each axis.
        levels: levels of a grid; each spans one step to both sides of the best point before.
        points: number of points of the other methods.
        sequences: names of the sequences; all with clouds if empty.
        frames: most clouds of each sequence in which the tool touches: deep ones that differ.
        measure: the error: "distance", the RMS of patch averages of the signed distance, or
            "paper", the mean distance of Wu, Kazanzides and Unberath (2020).
        seed: seed of all random draws.
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
            raise SetupError(
                f"a grid of {self.planned} points; expected at most {MOST_POINTS}: "
                "take fewer steps, or random, tpe or cmaes",
                key="steps",
                value=self.steps,
            )
        if self.method == "cmaes" and len(self.space.axes) < 2:
            raise SetupError(
                "CMA-ES needs two parameters or more; take tpe or grid for one",
                key="method",
                value="cmaes",
            )

    @property
    def planned(self) -> int:
        """Number of points that the method visits."""
        return (
            self.levels * self.steps ** len(self.space.axes)
            if self.method == "grid"
            else self.points
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
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
        """Return the specification that `to_json` wrote; missing keys have their defaults."""
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
