"""View of a first look, as a page sends it."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

__all__ = ["LookLayer", "LookView"]

LookLayer = Literal["raw", "cleaned", "tool", "path", "surface"]


class LookView(BaseModel):
    """One time of one recording of a look, and the layers that are shown.

    The cloud that is stored next to `time` [s] is drawn: `raw` in one colour, `cleaned` by the
    reason of each point, without the `hidden` reasons. Where both are asked for, it is `cleaned`.
    Without a name of a recording it is the first.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={
            "examples": [{"look": "look-20260101-120000-abcd", "recording": "bench", "time": 12.5}]
        },
    )

    look: str = Field(max_length=200)
    recording: str | None = Field(default=None, max_length=200)
    time: FiniteFloat = 0.0
    layers: tuple[LookLayer, ...] = Field(
        default=("cleaned", "tool", "path", "surface"), max_length=5
    )
    hidden: tuple[str, ...] = Field(default=(), max_length=20)
