"""Which landmarks the touches were really of, how far apart, and how far inside: from the touches
alone, before any replay.

The pairing is a word and no number, so every word is tried; for each the polygon's scale and inset
follow by least squares. Whether that is the cause, and no other size of the phantom, is for the
whole of the evidence to say.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.diagnosis.inference.rest_evidence import TOUCH
from palpate.effects.tool import LandmarkMismatch
from palpate.foundation.arrays import FloatArray
from palpate.measurement.touch_correction import touch_misses
from palpate.mesh.protocol import Meshing
from palpate.registration.landmark_repair import Repair, pairings_for
from palpate.setup.setup import Setup

__all__ = ["FEW", "fitted", "mismatches", "mispaired"]

FEW = 3
"""How many pairings are worth more than their misfit."""
_SPREADS = np.array([0.08, 2e-3])
"""Prior deviation of scale [1] and inset [m]: four steps that matter, as for any search
coordinate."""
_ROUNDS, _STEPS = 8, np.array([1e-4, 1e-6])


def fitted(setup: Setup, grid: Meshing, pairing: str) -> tuple[LandmarkMismatch, float]:
    """The most probable scale and inset with this pairing, and what touches and priors then cost,
    half a chi squared [nats].
    """
    effect = LandmarkMismatch(pairing=pairing, scale=1.0, inset=0.0)

    def misses(one: LandmarkMismatch) -> FloatArray:
        own = (np.array([one.scale - 1.0, one.inset])) / _SPREADS
        return np.concatenate([touch_misses(one.apply(setup), grid).ravel() / TOUCH, own])

    for _ in range(_ROUNDS):
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
        if (np.abs(change) < 1e-3 * _SPREADS).all():
            break
    return effect, 0.5 * float(misses(effect) @ misses(effect))


def mismatches(setup: Setup, grid: Meshing) -> list[tuple[LandmarkMismatch, float]]:
    """The FEW pairings whose touches cost least, best first, with what that is less than as stated
    [nats].
    """
    stated = 0.5 * float(((touch_misses(setup, grid) / TOUCH) ** 2).sum())
    found = [fitted(setup, grid, pairing) for pairing in pairings_for(len(setup.landmarks))]
    ranked = sorted(found, key=lambda row: row[1])[:FEW]
    return [(effect, stated - cost) for effect, cost in ranked]


def mispaired(setup: Setup, grid: Meshing, repair: Repair | None) -> tuple[LandmarkMismatch, ...]:
    """The mismatch from which a diagnosis has to start, as nothing can be replayed without it; none
    where the pairing stands.
    """
    if repair is None or repair.pairing == setup.touching.pairing:
        return ()
    plain = replace(setup, touching=replace(setup.touching, scale=1.0, inset=0.0))
    return (fitted(plain, grid, repair.pairing)[0],)
