"""Correction inside a replay: each frame's shape, corrected, as a frame like any other.

What the network says of its grid is interpolated linearly to the nodes that were solved on, so that the dent keeps its detail.
Three ways to feed it back:

    none    only the points that the network corrects are moved
    follow  the simulation answers for all others, see `palpate.correction.elastic_extension`
    start   as follow, and the next frame is solved from there

An elastic block in equilibrium has no memory: from wherever a frame is solved, it ends in the same place, and `start` can only
change how many iterations that takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
import torch

from palpate.correction.elastic_extension import ElasticExtension
from palpate.correction.networks.architectures import CorrectionNetwork
from palpate.correction.networks.chamfer import hold_weights
from palpate.correction.networks.unet_inference import UNetInference
from palpate.correction.trained_network import TrainedNetwork
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import CorrectionError
from palpate.mesh.box_mesh import BoxMesh, GridSpec, box_mesh
from palpate.mesh.protocol import Meshing
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import Replay
from palpate.setup.setup import Setup

__all__ = ["FEEDBACKS", "CorrectedFrame", "Corrector", "Feedback", "replay_corrected"]

Feedback = Literal["none", "follow", "start"]
FEEDBACKS: tuple[str, ...] = get_args(Feedback)


class Corrector:
    """A trained network on the frames of one setup's replay.

    Args:
        trained: the network.
        setup: of the frames.
        feedback: see the module.
        half: bfloat16 inside, see `palpate.correction.networks.unet_inference`.
    """

    def __init__(
        self,
        trained: TrainedNetwork,
        setup: Setup,
        *,
        feedback: Feedback = "none",
        half: bool | None = None,
    ) -> None:
        if feedback not in FEEDBACKS:
            raise CorrectionError(
                f"feedback = {feedback!r}; expected one of {', '.join(FEEDBACKS)}",
                key="feedback",
                value=feedback,
            )
        self.body, self.feedback = trained.body, feedback
        self.measured_force = trained.about.get("force") == "measured"
        self._network = _single(trained.network, half)
        self._lattice = self._mesh(setup)
        self._following: ElasticExtension | None = None
        if feedback != "none" and self._lattice is not None:
            self._following = ElasticExtension(setup, self._lattice, self._driven(trained))

    def _mesh(self, setup: Setup) -> BoxMesh | None:
        """The grid of all the samples' points; None for a body that is no grid."""
        grid = self.body.grid
        if grid is None:
            return None
        if len(grid) == 2:
            layers = round(setup.box.size[2] / float(self.body.voxel[2])) + 1
            grid = (*grid, layers)
        return box_mesh(setup.box.size, GridSpec(nodes=(grid[0], grid[1], grid[2])))

    def _driven(self, trained: TrainedNetwork) -> IntArray:
        """What the network is believed of: the top, or all points that the camera sees."""
        if self.body.flat:
            return self.body.index
        seen = np.asarray(trained.about["seen"], dtype=float)
        return np.flatnonzero(hold_weights(seen) < 0.5)

    def correction(self, frame: Equilibrium, tool: FloatArray) -> FloatArray:
        """How far the body's points are moved (v, 3) [m]; tool (13,) as in the samples, a simulated
        force is the frame's.
        """
        known = torch.as_tensor(tool, dtype=torch.float32)
        if not self.measured_force:
            known[10:] = torch.as_tensor(frame.force, dtype=torch.float32)
        simulated = torch.as_tensor(frame.move(self.body.rest), dtype=torch.float32)
        return np.asarray((self._network(simulated, known) - simulated).numpy(), dtype=float)

    def correct(self, frame: Equilibrium, tool: FloatArray) -> Equilibrium:
        """The frame with its shape corrected; all else is the simulation's."""
        moved = self.correction(frame, tool)
        if self._lattice is None:
            if len(frame.mesh.nodes) != len(moved) or not np.allclose(
                frame.mesh.nodes, self.body.rest, atol=1e-9
            ):
                raise CorrectionError(
                    "the frame is of another mesh than the network was trained on; replay on that one",
                    key="mesh",
                )
            return replace(frame, displacement=frame.displacement + moved)
        everywhere = np.zeros((len(self._lattice.nodes), 3))
        everywhere[self.body.index] = moved
        if self._following is not None:
            everywhere = self._following(everywhere)
        return replace(
            frame,
            displacement=frame.displacement
            + self._lattice.interpolate(everywhere, frame.mesh.nodes),
        )


def _single(
    network: CorrectionNetwork, half: bool | None
) -> Callable[[torch.Tensor, torch.Tensor], torch.Tensor]:
    """The network for one frame (v, 3) and tool (13,)."""
    if network.spec.kind != "graph":
        return UNetInference(network, half)
    plain = network.cpu().eval()

    def single(vertices: torch.Tensor, tool: torch.Tensor) -> torch.Tensor:
        with torch.inference_mode():
            found: torch.Tensor = plain(vertices[None], tool[None])[0]
            return found

    return single


@dataclass(frozen=True, eq=False)
class CorrectedFrame:
    """A frame as simulated and as corrected."""

    raw: Equilibrium
    corrected: Equilibrium


def replay_corrected(
    corrector: Corrector,
    setup: Setup,
    centres: FloatArray,
    tools: FloatArray,
    grid: Meshing,
    *,
    times: FloatArray | None = None,
    tolerance: float = 1e-3,
) -> Iterator[CorrectedFrame]:
    """Each frame of a replay, corrected; one at a time.

    Args:
        centres: (f, 3) stated tool centres [m], phantom frame.
        tools: (f, 13) as in the samples.
        grid: the mesh.
        times: (f,) [s], for a material with memory.
        tolerance: residual at which a frame counts as converged, over the push.

    A frame without equilibrium is returned as it is: there is nothing to correct.
    """
    block, previous, start = Replay(setup, grid, tolerance), None, None
    for number, centre in enumerate(centres):
        time = None if times is None else float(times[number])
        raw = block.solve_from_any(centre, (start, previous), time)
        if raw.outcome is not Outcome.CONVERGED:
            previous = start = previous if setup.has_history else None
            yield CorrectedFrame(raw, raw)
            continue
        corrected = corrector.correct(raw, tools[number])
        previous = raw
        start = corrected if corrector.feedback == "start" and not setup.has_history else raw
        yield CorrectedFrame(raw, corrected)
