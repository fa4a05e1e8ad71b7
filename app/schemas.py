"""What goes over the wire."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from app.picture import Colouring, Layer
from app.records import Job

__all__ = ["DiagnosisRequest", "EffectIn", "JobOut", "View", "WhatIfRequest"]


class View(BaseModel):
    """What a page wants to see; `limit` is the end of the error scale [m], None for automatic."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    run: str
    sequence: str
    frame: int = Field(default=0, ge=0)
    layers: tuple[Layer, ...] = ("measured", "raw", "extended", "tool")
    colour: Colouring = "plain"
    limit: float | None = Field(default=None, gt=0.0, le=1.0)
    crop: bool = True


class DiagnosisRequest(BaseModel):
    """Which dataset to diagnose, named by its folder."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    dataset: str
    seed: int = Field(default=0, ge=0, lt=2**31)


class EffectIn(BaseModel):
    """An effect of the catalogue with all of its parameters, SI."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    effect: str
    parameters: dict[str, float | str]


class WhatIfRequest(BaseModel):
    """A frame of a recording and the causes to solve it with; `page` shows it there."""

    model_config = ConfigDict(
        frozen=True, extra="forbid",
        json_schema_extra={"examples": [{"frame": 35, "effects": [{"effect": "tool_radius", "parameters": {"radius": 0.006}}]}]},
    )  # fmt: skip

    frame: int = Field(ge=0)
    effects: tuple[EffectIn, ...] = Field(default=(), max_length=12)
    tuned: bool = True
    page: str | None = None


class JobOut(BaseModel):
    """A job as the page sees it: without folders of this machine."""

    id: str
    kind: str
    dataset: str | None
    state: str
    fraction: float
    text: str
    created: float
    started: float | None
    finished: float | None
    error: dict[str, Any] | None
    result: dict[str, Any] | None

    @classmethod
    def of(cls, job: Job) -> JobOut:
        """The public part of a record."""
        shown = {name: getattr(job, name) for name in cls.model_fields if name != "dataset"}
        return cls(dataset=job.request.get("name"), **shown)
