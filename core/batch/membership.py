"""Which setups a batch can hold; the others are replayed one by one."""

from __future__ import annotations

from dataclasses import fields

from core.setup import Box, Setup

__all__ = ["obstacle"]

_HELD = {
    "material": {
        "young_modulus", "poisson_ratio", "law", "inclusions", "layer", "log_ratio", "stretch_limit", "fibres",
    },
    "load": {"specific_weight_over_stiffness"},
    "support": set(),
    "tool": {"radius", "offset"},
}  # fmt: skip
"""What may differ from its default in a batch. Whatever a Setup learns later is not in here, and so cannot be overlooked."""


def obstacle(setup: Setup) -> str | None:
    """The key of a setup that keeps it out of a batch; None when nothing does."""
    if type(setup.geometry) is not Box:
        return "geometry"
    if setup.element_size is not None:
        return "element_size"
    if setup.material.law != "neo_hooke":
        return "material.law"
    for name, held in _HELD.items():
        part = getattr(setup, name)
        for field in fields(part):
            if field.name not in held and getattr(part, field.name) != field.default:
                return f"{name}.{field.name}"
    return None
