"""Probabilities of sets of causes from their gains."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.diagnosis.criteria import CRITERIA

__all__ = ["probabilities"]


Names = tuple[str, ...]


def probabilities(
    surplus: Mapping[Names, float], temperature: float = CRITERIA.naming.probability_temperature
) -> dict[Names, float]:
    """Return the softmax over sets of causes, the set without any included.

    The required gain is part of the odds, so that a set that the search rejected for too small a
    gain is less probable than a named one.

    Args:
        surplus: gain of each set beyond its required gain [nats]; minus infinity for a set that was
            rejected whatever its gain.
        temperature: by which the surplus is divided.
    """
    every = {(): 0.0, **surplus}
    logits = np.array(list(every.values())) / temperature
    weights = np.exp(logits - logits.max())
    return {names: float(w) for names, w in zip(every, weights / weights.sum(), strict=True)}
