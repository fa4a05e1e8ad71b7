"""Bodies of requests and answers that several endpoints share."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

__all__ = [
    "PROBLEMS",
    "DiagnosisRequest",
    "EffectIn",
    "HalfPair",
    "Health",
    "JobOut",
    "LiveRequest",
    "NoteOut",
    "Notes",
    "Point",
    "Problem",
    "RegistrationView",
    "WeakDirection",
    "WhatIfRequest",
]


class Problem(BaseModel):
    """Body of every error: its kind, a sentence on what to do, and its place (file, row, key, value
    ...).
    """

    kind: str
    message: str
    where: dict[str, int | float | str | bool]


PROBLEMS: dict[int | str, dict[str, Any]] = {
    status: {"model": Problem, "description": text}
    for status, text in {
        400: "the body cannot be read",
        401: "not logged in: send Authorization: Bearer with the token",
        403: "requested by a page of another site, or under a name that is not the server's",
        404: "nothing has this name",
        409: "does not fit the state of what it names",
        413: "the body is too large",
        422: "data or values that are off",
        507: "the disk is full",
    }.items()
}
"""Error answers of every operation."""


Point = Annotated[
    list[Annotated[FiniteFloat, Field(ge=-10.0, le=10.0)]], Field(min_length=3, max_length=3)
]
"""A place [m]."""
Row = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]


class Health(BaseModel):
    """State of the server: `troubled` where the job queue does not work, or lately did not."""

    status: Literal["ok", "troubled"]


class HalfPair(BaseModel):
    """A pair that is being clicked: a point [m] on the cloud, camera frame, and one on the mesh,
    phantom frame; each may be missing.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    cloud: Point | None = None
    mesh: Point | None = None


class WeakDirection(BaseModel):
    """A motion that the cloud determines weakly: its translation and rotation along the phantom's
    axes, and a text.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    translation: Point
    rotation: Point
    text: str = Field(max_length=80)


class RegistrationView(BaseModel):
    """Manual registration as a page shows it.

    `mode` is the side that clicks select. The cloud is drawn by `pose` (phantom_from_camera) if it
    was fitted, else by `start`: as stated in dataset.toml, levelled by its table, or as the camera
    sees it; `over` the phantom, or beside it.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={"examples": [{"dataset": "block-01", "mode": "cloud"}]},
    )

    dataset: str
    pairs: tuple[HalfPair, ...] = Field(default=(), max_length=100)
    mode: Literal["cloud", "mesh"] = "cloud"
    chosen: tuple[Annotated[int, Field(ge=0, lt=100)], Literal["cloud", "mesh"]] | None = None
    pose: (
        Annotated[
            list[Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]],
            Field(min_length=4, max_length=4),
        ]
        | None
    ) = None
    start: Literal["stated", "levelled", "camera"] = "stated"
    over: bool = False
    weak: tuple[WeakDirection, ...] = Field(default=(), max_length=6)


class DiagnosisRequest(BaseModel):
    """A dataset to diagnose, by its folder's name, an accepted registration that replaces the
    automatic one, and the size [m] from which on structured error matters.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={"examples": [{"dataset": "block-01", "seed": 0}]},
    )

    dataset: str
    seed: int = Field(default=0, ge=0, lt=2**31)
    registration: str | None = None
    tolerance: float | None = Field(default=None, ge=0, lt=1)


class EffectIn(BaseModel):
    """An effect of the catalogue with all of its parameters, SI."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    effect: str
    parameters: dict[str, FiniteFloat | str]


class WhatIfRequest(BaseModel):
    """A frame of a recording and the effects to solve it with; `page` shows the result."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "frame": 35,
                    "effects": [{"effect": "tool_radius", "parameters": {"radius": 0.006}}],
                }
            ]
        },
    )

    frame: int = Field(ge=0)
    effects: tuple[EffectIn, ...] = Field(default=(), max_length=12)
    tuned: bool = True
    page: str | None = None


class LiveRequest(BaseModel):
    """Requested position of the tool's centre [m], phantom frame, and the model that answers.

    `page` shows the result in place of the run's model `shown`.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={"examples": [{"at": [0.0, 0.0, 0.038], "effects": [], "tuned": False}]},
    )

    at: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    effects: tuple[EffectIn, ...] = Field(default=(), max_length=12)
    tuned: bool = True
    shown: Literal["raw", "extended"] = "extended"
    page: str | None = None


class JobOut(BaseModel):
    """A job without folders of this machine.

    Times are seconds since 1970. `seconds` is how long it has run, at its last progress or at its
    end [s]; a clock that is set does not change it. `remaining` is estimated [s]. `can_retry` says
    whether POST /api/jobs/{id}/retry would repeat it.
    """

    id: str
    kind: str
    dataset: str | None
    state: str
    fraction: float
    text: str
    created: float
    started: float | None
    finished: float | None
    seconds: float
    error: dict[str, Any] | None
    result: dict[str, Any] | None
    attempt: int
    remaining: float | None
    can_retry: bool


class NoteOut(BaseModel):
    """A line of a job's log: time [s since 1970], level (info, warning or error), text."""

    at: float
    level: str
    text: str


class Notes(BaseModel):
    """Lines of a log in the order of time, and the `after` of the next request."""

    notes: list[NoteOut]
    next: int
