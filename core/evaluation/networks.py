"""A trained network as an evaluation and a recording use it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from core.dataset import Sequence as Recording
from core.errors import RunError
from core.evaluation.corrected import Correct
from core.evaluation.training import REQUEST
from core.frames import FloatArray
from core.meshing import Meshing
from core.setup import Setup
from core.touches import touch_correction

if TYPE_CHECKING:
    from core.correction import Trained
    from core.correction.inference import Feedback

__all__ = ["Network"]


@dataclass(frozen=True, eq=False)
class Network:
    """One trained network of a block.

    Attributes:
        trained: as it was kept. about: what a reader wants to know of it, plain values. feedback: whether the simulation answers
            for the points that the network does not see ("follow") or not ("none"), see `core.correction.inference`.
    """

    trained: Trained
    about: dict[str, Any]
    feedback: Feedback = "none"

    @classmethod
    def load(cls, folder: Path, feedback: Feedback = "none") -> Self:
        """From the folder of a training that is finished; RunError where there is none."""
        from core.correction import Trained  # noqa: PLC0415 (heavy)

        try:
            asked = json.loads((folder / REQUEST).read_text())
        except (OSError, ValueError) as error:
            raise RunError(f"{folder} holds no training ({error}); train first", path=str(folder)) from None
        trained = Trained.load(folder)
        spec, known = trained.about["training"], trained.about
        about = {
            "kind": spec["network"]["kind"], "features": spec["network"]["features"], "trust": spec["network"]["trust"],
            "hold": spec["hold"], "every": asked["every"], "seed": spec["seed"], "epoch": known["epoch"],
            "validation_error": known["error"], "validation_error_without": known["raw_error"],
            "feedback": feedback,
        }  # fmt: skip
        return cls(trained, about, feedback)

    def corrector(self, setup: Setup) -> Correct:
        """What corrects a frame of this setup."""
        from core.correction import Corrector  # noqa: PLC0415 (heavy)

        return Corrector(self.trained, setup, feedback=self.feedback).correct

    def columns(self, sequence: Recording, times: FloatArray, setup: Setup, grid: Meshing) -> FloatArray:
        """What it is told of the tool (n, 13) at cloud stamps (n,) [s] under a setup."""
        from core.correction.sampling import tool_columns  # noqa: PLC0415 (heavy)

        robot = touch_correction(setup, grid) @ setup.phantom_from_robot
        return tool_columns(sequence, times - setup.sensor.time_offset, robot, self.trained.about["force"] == "measured")
