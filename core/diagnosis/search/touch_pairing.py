"""The landmarks that the touches were really of, from the touches alone, before any replay.

A pairing of touches with landmarks is a word and no number, so every pairing is tried. The size of
the touched polygon and the inset of the touches follow by least squares. The whole evidence decides
whether that is the cause, and not another size of the phantom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.noise.rest_evidence import touch_deviation
from palpate.effects import Effect
from palpate.foundation.arrays import FloatArray
from palpate.measurement.touch_correction import touch_misses
from palpate.mesh.protocol import Meshing
from palpate.registration.robot.landmark_repair import LandmarkRepair
from palpate.setup.setup import Setup

__all__ = ["fitted_to_touches", "known_mismatch"]

_SPREADS = np.array(
    [CRITERIA.touch_pairing.scale_deviation, CRITERIA.touch_pairing.inset_deviation]
)
"""Prior deviations of scale [1] and inset [m]."""
_STEPS = np.array([CRITERIA.touch_pairing.scale_step, CRITERIA.touch_pairing.inset_step])


def fitted_to_touches(start: Effect, setup: Setup, grid: Meshing) -> tuple[Effect, float]:
    """Return the effect with its most probable scale and inset, and its cost [nats].

    The cost is half the chi squared of the touches and the priors.

    Args:
        start: effect on the touches, its numbers as stated.
        setup: with the residuals of the touches.
        grid: mesh for the sag of the landmarks.
    """
    stated = np.array(start.coordinates)

    def misses(one: Effect) -> FloatArray:
        own = (np.array(one.coordinates) - stated) / _SPREADS
        return np.concatenate(
            [touch_misses(one.apply(setup), grid).ravel() / touch_deviation(setup), own]
        )

    effect = start
    for _ in range(CRITERIA.touch_pairing.rounds):
        here, values = misses(effect), np.array(effect.coordinates)
        near = [
            effect.moved((values + step * own).tolist())
            for step, own in zip(_STEPS, np.eye(len(values)), strict=True)
        ]
        slopes = np.stack(
            [(misses(other) - here) / step for other, step in zip(near, _STEPS, strict=True)],
            axis=1,
        )
        change = -np.linalg.lstsq(slopes, here, rcond=None)[0]
        effect = effect.moved((values + change).tolist())
        if (np.abs(change) < CRITERIA.touch_pairing.settled * _SPREADS).all():
            break
    return effect, 0.5 * float(misses(effect) @ misses(effect))


def known_mismatch(
    catalogue: Sequence[type[Effect]], setup: Setup, grid: Meshing, repair: LandmarkRepair | None
) -> tuple[Effect, ...]:
    """Return the effects without which nothing can be replayed: touches of other landmarks.

    Args:
        catalogue: effects, of which those on the touches count.
        setup: as stated.
        grid: mesh for the sag of the landmarks.
        repair: of the pairing, as the registration found it; None for a right pairing.
    """
    if repair is None or repair.pairing == setup.touching.pairing:
        return ()
    plain = replace(setup, touching=replace(setup.touching, scale=1.0, inset=0.0))
    starts = (kind.of_touches(repair.pairing) for kind in catalogue)
    return tuple(fitted_to_touches(one, plain, grid)[0] for one in starts if one is not None)
