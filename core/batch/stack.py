"""Tensors that go together, one entry per body along their first axis."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import torch
from torch import Tensor

__all__ = ["Stack"]


@dataclass(frozen=True, eq=False)
class Stack:
    """A dataclass of tensors (b, ...)."""

    def pick(self, bodies: Tensor) -> Self:
        """Some of the bodies, by their numbers (c,)."""
        return type(self)(*(getattr(self, field.name)[bodies] for field in fields(self)))

    def to(self, dtype: torch.dtype) -> Self:
        """In another precision."""
        return type(self)(*(getattr(self, field.name).to(dtype) for field in fields(self)))
