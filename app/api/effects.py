"""The catalogue of effects with parameters, units and bounds, as a whole or for a dataset."""

from __future__ import annotations

import math
from typing import Annotated, Any

from fastapi import APIRouter, Query

from palpate.app.services import CurrentServices
from palpate.effects import CATALOGUE, DIAGNOSED, Effect, Parameter
from palpate.setup.setup import Setup

__all__ = ["router"]

router = APIRouter(prefix="/effects", tags=["effects"])


@router.get("")
def listed(
    services: CurrentServices, dataset: Annotated[str | None, Query(max_length=64)] = None
) -> list[dict[str, Any]]:
    """The catalogue of effects. Only replays and sweeps use those that are not `diagnosed`; only a
    diagnosis sets the numbers of those that are not `by_hand`.

    Bounds are SI, null where there is none. `scale` is a significant step: of the logarithm where
    `log`, of the contrast (k - 1) / (k + 3/2) where `contrast`.

    With a dataset, `impossible` says why it cannot have the effect, null where it can, and the
    `span` of a parameter are the values (SI) between which it makes sense in this phantom, such as
    places; null where the bounds are all there is. `begin` is a value for those that are not
    varied.
    """
    entries = [_described(effect) for effect in CATALOGUE]
    if dataset is None:
        return entries
    from palpate.registration.registration import unregistered_setup

    setup = unregistered_setup(services.library.open(dataset))
    for effect, entry in zip(CATALOGUE, entries, strict=True):
        impossible, spans = effect.impossible(setup), effect.spans(setup.geometry)
        begin = {} if impossible else _begin(effect, setup).values()
        entry["impossible"] = impossible or None
        for item in entry["parameters"]:
            item["span"], item["begin"] = spans.get(item["name"]), begin.get(item["name"])
    return entries


def _begin(effect: type[Effect], setup: Setup) -> Effect:
    """Values at which a number that is varied alone has an effect: as stated, or of a part of
    finite stiffness, where its place or size alone would change nothing.
    """
    starts = effect.starts(setup) if effect.amplitude else ()
    return starts[len(starts) // 2] if starts else effect.neutral(setup)


def _described(effect: type[Effect]) -> dict[str, Any]:
    return {
        "name": effect.name,
        "enters": effect.enters.value,
        "summary": effect.summary,
        "diagnosed": effect in DIAGNOSED,
        "by_hand": effect.by_hand,
        "parameters": [_parameter(item) for item in effect.parameters()],
    }


def _parameter(item: Parameter) -> dict[str, Any]:
    low, high = (
        None if item.choices or not math.isfinite(bound) else bound
        for bound in (item.low, item.high)
    )
    return {
        "name": item.name,
        "unit": item.unit,
        "low": low,
        "high": high,
        "choices": list(item.choices),
        "scale": None if item.choices else item.scale,
        "log": item.log,
        "contrast": item.contrast,
    }
