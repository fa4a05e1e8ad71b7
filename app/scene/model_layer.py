"""One model of a replayed sequence: surface, tool, interior and quantities in each frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from palpate.app.drawing.colours import nice_end, nice_limit
from palpate.app.drawing.view import MODELS, Model, Quantity
from palpate.app.storage.run_store import RecordedReplay
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.recording.interior_fields import InteriorFields

__all__ = ["NO_INSIDE", "FrameSolution", "ModelLayer", "end_of_scale", "model_layers"]

NO_INSIDE = "this diagnosis was made before the inside was recorded: make it again to see it"
ROBUST_SHARES = {"error": 0.95, "displacement": 0.998, "energy": 0.9}
"""Share of all values within a robust scale [1]; errors are noise at most places, the other
quantities almost zero."""


class FrameSolution(Protocol):
    """A frame solved again, with arrays as in `palpate.recording.resolve_frame.ResolvedFrame`."""

    @property
    def surface(self) -> FloatArray: ...

    @property
    def error(self) -> FloatArray: ...

    @property
    def tool(self) -> FloatArray: ...

    @property
    def radius(self) -> float: ...

    @property
    def camera(self) -> FloatArray: ...

    @property
    def inside(self) -> InteriorFields | None: ...


@dataclass(frozen=True, eq=False)
class ModelLayer:
    """A model in a sequence; `solution` replaces the recorded frame `instead`."""

    replay: RecordedReplay
    model: Model
    inside: InteriorFields | None
    instead: int | None = None
    solution: FrameSolution | None = None

    def surface(self, frame: int) -> FloatArray:
        """Moved vertices (v, 3) [m]."""
        return np.asarray(
            self._solution(frame).surface
            if frame == self.instead
            else self.replay[self.model][frame],
            dtype=float,
        )

    def tool(self, frame: int) -> tuple[FloatArray, float]:
        """Centre (3,) and radius [m]."""
        if frame == self.instead:
            return np.asarray(self._solution(frame).tool, dtype=float), float(
                self._solution(frame).radius
            )
        return np.asarray(self._own("tool")[frame], dtype=float), float(self._own("tool_radius"))

    @property
    def path(self) -> FloatArray:
        """Centres of the tool in all frames (f, 3) [m]."""
        return np.asarray(self._own("tool"), dtype=float)

    def camera(self, frame: int) -> Transform:
        """phantom_from_camera."""
        return Transform.from_matrix(
            np.asarray(
                self._solution(frame).camera if frame == self.instead else self._own("camera")
            )
        )

    def values(self, quantity: Quantity, frame: int) -> FloatArray | None:
        """The quantity at the vertices (v,), NaN where unknown; None where the run does not contain
        it.
        """
        if quantity == "error":
            return np.asarray(
                self._solution(frame).error
                if frame == self.instead
                else self.replay[f"error_{self.model}"][frame]
            )
        if quantity == "displacement":
            return np.asarray(np.linalg.norm(self.surface(frame) - self.replay["rest"], axis=1))
        return self.within(quantity, frame, self.replay["rest"])

    def within(self, quantity: Quantity, frame: int, places: FloatArray) -> FloatArray | None:
        """The quantity (m,) at places (m, 3) [m] of the block at rest; None where it is unknown."""
        inside, at = self._inside(frame)
        if inside is None or quantity == "error":
            return None
        if quantity == "displacement":
            return np.asarray(np.linalg.norm(inside.displacement(at, places), axis=1))
        return inside.energy_density(at, places)

    def moved(self, frame: int, places: FloatArray) -> FloatArray | None:
        """Current places of the material at (m, 3) [m] at rest; None where the run has
        no interior.
        """
        inside, at = self._inside(frame)
        return None if inside is None else places + inside.displacement(at, places)

    def _inside(self, frame: int) -> tuple[InteriorFields | None, int]:
        return (self._solution(frame).inside, 0) if frame == self.instead else (self.inside, frame)

    def _solution(self, frame: int) -> FrameSolution:
        if self.solution is None:
            raise ValueError(f"there is no solution for frame {frame}")
        return self.solution

    def _own(self, key: str) -> Any:
        """Data of this model; a correction uses those of the model it is based on."""
        names = (f"{key}_{model}" for model in (self.model, "extended", "raw"))
        return next(self.replay[name] for name in names if name in self.replay.arrays)


def model_layers(replay: RecordedReplay) -> dict[Model, ModelLayer]:
    """The layers of all models in a run."""
    held = [
        model for model in MODELS if model in replay.arrays and f"error_{model}" in replay.arrays
    ]
    return {
        model: ModelLayer(replay, model, InteriorFields.read(replay.arrays, model))
        for model in held
    }


def end_of_scale(replay: RecordedReplay, quantity: Quantity) -> float | None:
    """Round end of the scale for a whole sequence, by the raw model; None without the quantity."""
    share = ROBUST_SHARES[quantity]
    if quantity == "error":
        return nice_limit(replay["error_raw"])
    if quantity == "displacement":
        return nice_end(np.linalg.norm(replay["raw"] - replay["rest"], axis=2), share, 1e-4, 1e-3)
    inside = InteriorFields.read(replay.arrays, "raw")
    if inside is None:
        return None
    energy = np.asarray(inside.energy, dtype=float)
    return nice_end(inside.modulus * energy[energy > 0], share, 1e-2, 1.0)
