"""The catalogue of effects with parameters, units and bounds."""

from __future__ import annotations

import math
from typing import Any

from fastapi import APIRouter

from palpate.effects import CATALOGUE, DIAGNOSED, Effect, Parameter

__all__ = ["router"]

router = APIRouter(prefix="/effects", tags=["effects"])


@router.get("")
def listed() -> list[dict[str, Any]]:
    """The catalogue of effects. Only replays and sweeps use those that are not `diagnosed`; only a
    diagnosis sets the numbers of those that are not `by_hand`.

    Bounds are SI, null where there is none. `scale` is a significant step: of the logarithm where
    `log`, of the contrast (k - 1) / (k + 3/2) where `contrast`.
    """
    return [_described(effect) for effect in CATALOGUE]


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
