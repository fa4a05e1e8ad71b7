"""A tool on a spring, and a base that slips on the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.replay.equilibrium import Equilibrium
from palpate.setup.setup import Setup

__all__ = [
    "GRAVITY",
    "nearest_node",
    "sideways_indentation",
    "slip_from_force",
    "slip_step",
    "solve_compliant_tool",
    "weight_of",
]

GRAVITY = 9.81
"""Acceleration of free fall [m/s^2]."""

_PLACED, _MOST_PLACES = 1e-2, 30
"""Accuracy to which a compliant tool is placed [m], over the replay's tolerance, and largest number
of attempts."""
_LONGEST_SLIDE = 1e-3
_SHALLOWEST = 2e-4
_HELD = 2e-4
"""A base stays if friction holds all but this share of the push [1]."""
_STIFFENING = 1.5
"""Stiffness of a push over the ratio of its force and depth [1]. It is 1.5 for a ball on a flat,
whose force grows with the depth to the power 1.5 (Hertz), and less for deeper ones. A slip by this
value stops short of where friction holds; a base moved beyond that point would stay there."""


def solve_compliant_tool(
    centre: FloatArray,
    start: Equilibrium,
    setup: Setup,
    tolerance: float,
    placed: Callable[[FloatArray, Equilibrium], Equilibrium],
) -> Equilibrium:
    """Solve for the equilibrium with the tool on a spring, by Broyden's method on its true centre.

    Args:
        centre: (3,) of the spring's fixed end [m].
        start: frame to begin from.
        setup: the experiment.
        tolerance: of the replay.
        placed: solves with the tool's centre fixed at a position, from a start.
    """
    compliance, modulus = setup.tool.compliance_times_stiffness, setup.material.young_modulus
    softness, place = compliance / modulus, centre + compliance / modulus * start.force
    inverse = np.eye(3) / (
        1 + compliance * 2 * setup.tool.radius
    )  # a punch of the ball's size resists the most
    frame = placed(place, start)
    for _ in range(_MOST_PLACES):
        miss = centre + softness * frame.force - place
        if frame.outcome is not Outcome.CONVERGED or np.linalg.norm(miss) < _PLACED * tolerance:
            return frame
        step = inverse @ miss
        place = place + step
        frame = placed(place, start if setup.tool.friction_coefficient else frame)
        change = miss - (centre + softness * frame.force - place)
        turned = inverse @ change
        inverse += np.outer(step - turned, step @ inverse) / (step @ turned)
    return replace(frame, outcome=Outcome.TOOL_SWINGS)


def slip_step(frame: Equilibrium, friction: float, weight: float) -> FloatArray | None:
    """Next slip of the base (2,) [m]; None if Coulomb friction holds it.

    Args:
        frame: the equilibrium.
        friction: coefficient [1].
        weight: of the block [N]; it loads the base together with the tool's push.
    """
    if _excess(frame.force, friction, weight) <= _HELD * friction * weight:
        return None
    return slip_from_force(frame.force, sideways_indentation(frame), friction, weight)


def slip_from_force(force: FloatArray, reach: float, friction: float, weight: float) -> FloatArray:
    """Next slip (2,) [m] of a base that friction does not hold.

    Args:
        force: on the tool (3,) [N].
        reach: sideways indentation that belongs to it [m].
        friction: coefficient [1].
        weight: of the block [N].
    """
    push, pull = -force[:2], float(np.linalg.norm(force[:2]))
    stiffness = _STIFFENING * pull / max(reach, _SHALLOWEST)
    return np.asarray(
        push / pull * min(_excess(force, friction, weight) / stiffness, _LONGEST_SLIDE)
    )


def _excess(force: FloatArray, friction: float, weight: float) -> float:
    """Sideways push beyond what friction holds [N]."""
    return float(np.linalg.norm(force[:2])) - friction * max(weight + float(force[2]), 0.0)


def weight_of(setup: Setup) -> float:
    """Weight of the block [N]."""
    return setup.mass * GRAVITY


def nearest_node(frame: Equilibrium) -> int:
    """Number of the node nearest to the tool's centre."""
    surface = frame.mesh.nodes + frame.displacement
    return int(
        np.argmin(
            np.linalg.norm(surface - (frame.tool.centre - np.append(frame.slip, 0.0)), axis=1)
        )
    )


def sideways_indentation(frame: Equilibrium) -> float:
    """Sideways indentation that belongs to the push [m]: displacement of the touched material."""
    return float(np.linalg.norm(frame.displacement[nearest_node(frame), :2]))
