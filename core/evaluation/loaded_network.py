"""A trained network, loaded to correct the frames of an evaluation or of a recording."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from palpate.dataset import Sequence as Recording
from palpate.evaluation.corrected_prediction import FrameCorrection
from palpate.evaluation.train_network import REQUEST
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RunError
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup

if TYPE_CHECKING:
    from palpate.correction import TrainedNetwork
    from palpate.correction.corrected_replay import Feedback

__all__ = ["LoadedNetwork"]


@dataclass(frozen=True, eq=False)
class LoadedNetwork:
    """One trained network.

    Attributes:
        trained: the network as it was saved.
        about: description for reports, plain values.
        feedback: "follow" where the simulation moves the points that the network does not correct,
            "none" where they stay; see `palpate.correction.corrected_replay`.
    """

    trained: TrainedNetwork
    about: dict[str, Any]
    feedback: Feedback = "none"

    @classmethod
    def load(cls, folder: Path, feedback: Feedback = "none") -> Self:
        """Load the network of a finished training; RunError where there is none."""
        from palpate.correction import TrainedNetwork

        try:
            request = json.loads((folder / REQUEST).read_text())
        except (OSError, ValueError) as error:
            raise RunError(
                f"{folder} holds no training ({error}); train first", path=str(folder)
            ) from None
        trained = TrainedNetwork.load(folder)
        spec, known = trained.about["training"], trained.about
        about = {
            "kind": spec["network"]["kind"],
            "features": spec["network"]["features"],
            "trust": spec["network"]["trust"],
            "hold": spec["hold"],
            "every": request["every"],
            "seed": spec["seed"],
            "epoch": known["epoch"],
            "validation_error": known["error"],
            "validation_error_without": known["raw_error"],
            "feedback": feedback,
        }
        return cls(trained, about, feedback)

    def corrector(self, setup: Setup) -> FrameCorrection:
        """Return the correction of frames of this setup."""
        from palpate.correction import Corrector

        return Corrector(self.trained, setup, feedback=self.feedback).correct

    def columns(
        self, sequence: Recording, times: FloatArray, setup: Setup, grid: Meshing
    ) -> FloatArray:
        """Return the tool inputs (n, 13) at cloud stamps (n,) [s] under a setup."""
        from palpate.correction.samples.tool_columns import tool_columns

        robot = touch_correction(setup, grid) @ setup.phantom_from_robot
        return tool_columns(
            sequence,
            times - setup.sensor.time_offset,
            robot,
            self.trained.about["force"] == "measured",
        )
