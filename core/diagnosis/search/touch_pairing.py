"""Which landmarks the touches were really of, how far apart, and how far inside: from the touches
alone, before any replay.

The pairing is a word and no number, so every word is tried; for each the polygon's scale and inset
follow by least squares. Whether that is the cause, and no other size of the phantom, is for the
whole of the evidence to say.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.effects.tool import LandmarkMismatch
from palpate.foundation.arrays import FloatArray
from palpate.measurement.touch_correction import touch_misses
from palpate.mesh.protocol import Meshing
from palpate.registration.landmark_repair import Repair, pairings_for
from palpate.setup.setup import Setup

__all__ = ["fitted", "mismatches", "mispaired"]

_SPREADS = np.array(
    [CRITERIA.touch_pairing.scale_deviation, CRITERIA.touch_pairing.inset_deviation]
)
"""Prior deviations of scale [1] and inset [m]."""
_STEPS = np.array([CRITERIA.touch_pairing.scale_step, CRITERIA.touch_pairing.inset_step])


def fitted(setup: Setup, grid: Meshing, pairing: str) -> tuple[LandmarkMismatch, float]:
    """The most probable scale and inset with this pairing, and what touches and priors then cost,
    half a chi squared [nats].
    """
    effect = LandmarkMismatch(pairing=pairing, scale=1.0, inset=0.0)

    def misses(one: LandmarkMismatch) -> FloatArray:
        own = (np.array([one.scale - 1.0, one.inset])) / _SPREADS
        return np.concatenate(
            [touch_misses(one.apply(setup), grid).ravel() / CRITERIA.rest.touch_deviation, own]
        )

    for _ in range(CRITERIA.touch_pairing.rounds):
        here = misses(effect)
        near = [
            effect.moved([effect.scale + _STEPS[0], effect.inset]),
            effect.moved([effect.scale, effect.inset + _STEPS[1]]),
        ]
        slopes = np.stack(
            [(misses(other) - here) / step for other, step in zip(near, _STEPS, strict=True)],
            axis=1,
        )
        change = -np.linalg.lstsq(slopes, here, rcond=None)[0]
        effect = effect.moved([effect.scale + change[0], effect.inset + change[1]])
        if (np.abs(change) < CRITERIA.touch_pairing.settled * _SPREADS).all():
            break
    return effect, 0.5 * float(misses(effect) @ misses(effect))


def mismatches(setup: Setup, grid: Meshing) -> list[tuple[LandmarkMismatch, float]]:
    """The best pairings of the touches, best first, and how much less each costs than the stated
    pairing [nats].
    """
    stated = 0.5 * float(((touch_misses(setup, grid) / CRITERIA.rest.touch_deviation) ** 2).sum())
    found = [fitted(setup, grid, pairing) for pairing in pairings_for(len(setup.landmarks))]
    ranked = sorted(found, key=lambda row: row[1])[: CRITERIA.touch_pairing.most_pairings]
    return [(effect, stated - cost) for effect, cost in ranked]


def mispaired(setup: Setup, grid: Meshing, repair: Repair | None) -> tuple[LandmarkMismatch, ...]:
    """The mismatch from which a diagnosis has to start, as nothing can be replayed without it; none
    where the pairing stands.
    """
    if repair is None or repair.pairing == setup.touching.pairing:
        return ()
    plain = replace(setup, touching=replace(setup.touching, scale=1.0, inset=0.0))
    return (fitted(plain, grid, repair.pairing)[0],)
