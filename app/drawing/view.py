"""The view of a page, as it is sent to the server."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

__all__ = [
    "MODELS",
    "Camera",
    "Colouring",
    "Layer",
    "LayerStyle",
    "Model",
    "Quantity",
    "Section",
    "View",
]

Model = Literal["raw", "extended", "corrected"]
Layer = Literal[
    "measured", "raw", "extended", "corrected", "tool", "path", "landmarks", "base", "lump"
]
Colouring = Literal["plain", "raw", "extended", "corrected"]
Quantity = Literal["error", "displacement", "energy"]
Far = Annotated[float, Field(ge=-100.0, le=100.0)]
MODELS: tuple[Model, ...] = ("raw", "extended", "corrected")


class LayerStyle(BaseModel):
    """Style of one layer; None leaves it to `View.colour`.

    For the measured cloud `opacity` is the share of its points that are drawn.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    opacity: float = Field(default=1.0, ge=0.05, le=1.0)
    coloured: bool | None = None
    lines: bool | None = None


class Section(BaseModel):
    """A section through the block at rest, across an axis at a coordinate [m], phantom frame.

    The part beyond it is left out, with `flip` the part before it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    axis: Literal["x", "y", "z"] = "y"
    at: FiniteFloat = Field(default=0.0, ge=-1.0, le=1.0)
    flip: bool = False


class Camera(BaseModel):
    """Position of the camera for a run, and its target [m], phantom frame; z is upwards."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"run": "block-01-1", "position": [0.09, -0.17, 0.15], "target": [0.0, 0.0, 0.02]}
            ]
        },
    )

    run: str
    position: tuple[Far, Far, Far]
    target: tuple[Far, Far, Far]


class View(BaseModel):
    """The view of a page.

    `colour` is the model drawn as a coloured surface while the others are lines; `looks` overrides
    this for single layers. All coloured models show the same `quantity` on one scale. It ends at
    `limit` (error and displacement in m, energy density in J/m^3); where that is None, `scale` is
    `robust` (most values of the sequence) or `fixed` (the same for all sequences of the run).
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"run": "block-01-20260101-120000-abcd", "sequence": "poke-top-01", "frame": 35}
            ]
        },
    )

    run: str
    sequence: str
    frame: int = Field(default=0, ge=0)
    layers: tuple[Layer, ...] = ("measured", "raw", "extended", "tool")
    colour: Colouring = "plain"
    quantity: Quantity = "error"
    scale: Literal["robust", "fixed"] = "robust"
    limit: float | None = Field(default=None, gt=0.0, le=1e9)
    crop: bool = True
    side_by_side: bool = False
    section: Section | None = None
    looks: dict[Layer, LayerStyle] = Field(default_factory=dict)

    def opacity(self, layer: Layer) -> float:
        """Opacity of a layer, 0 to 1."""
        look = self.looks.get(layer)
        return 1.0 if look is None else look.opacity

    def models(self) -> tuple[Model, ...]:
        """The requested models, the most complete first."""
        return tuple(model for model in reversed(MODELS) if model in self.layers)

    def front(self, models: tuple[Model, ...]) -> Model | None:
        """The model whose surface is drawn where several overlap."""
        return next(
            (model for model in models if model == self.colour), models[0] if models else None
        )

    def coloured(self, model: Model, models: tuple[Model, ...]) -> bool:
        """Whether a model's surface shows the quantity."""
        look = self.looks.get(model)
        if look is not None and look.coloured is not None:
            return look.coloured
        return self.colour != "plain" and (
            self.side_by_side or self.colour == model == self.front(models)
        )

    def lines(self, model: Model, models: tuple[Model, ...]) -> bool:
        """Whether a model is drawn as grid lines."""
        look = self.looks.get(model)
        if look is not None and look.lines is not None:
            return look.lines
        return not self.side_by_side and model != self.front(models)
