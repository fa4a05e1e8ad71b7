"""From gains to probabilities of sets of causes (step 9 of the method)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.diagnosis.criteria import CRITERIA

__all__ = ["probabilities"]


Names = tuple[str, ...]


def probabilities(
    surplus: Mapping[Names, float], temperature: float = CRITERIA.naming.probability_temperature
) -> dict[Names, float]:
    """Softmax over sets of causes, and the set without any, of what each gains beyond what is asked
    of it [nats].

    What is asked is part of the odds: what the search refused for too little is less probable than
    what it named. Minus infinity is the surplus of a set that was refused whatever it gains.
    """
    every = {(): 0.0, **surplus}
    logits = np.array(list(every.values())) / temperature
    weights = np.exp(logits - logits.max())
    return {names: float(w) for names, w in zip(every, weights / weights.sum(), strict=True)}
