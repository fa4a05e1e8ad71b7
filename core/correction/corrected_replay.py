"""Replays whose frames a network corrects.

The network's correction of its grid is interpolated linearly to the nodes of the solved mesh, which
keeps the detail of the dent. It is fed back in one of three ways:

    none    only the points that the network corrects are moved
    follow  the simulation moves all other points, see `palpate.correction.elastic_extension`
    start   as follow, and the next frame is solved from the corrected shape

The equilibrium of an elastic body does not depend on where its solution starts, so `start` changes
only the number of iterations.
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
from palpate.correction.samples.embedding_grid import EmbeddingGrid
from palpate.correction.trained_network import TrainedNetwork
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import CorrectionError
from palpate.mesh.default_meshes import even_mesh
from palpate.mesh.interpolation import weighted_nodes
from palpate.mesh.protocol import Mesh, Meshing
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import Replay
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Setup

__all__ = ["FEEDBACKS", "CorrectedFrame", "Corrector", "Feedback", "replay_corrected"]

Feedback = Literal["none", "follow", "start"]
FEEDBACKS: tuple[str, ...] = get_args(Feedback)


class Corrector:
    """Applies a trained network to the frames of one setup.

    Args:
        trained: the network.
        setup: the setup of the frames.
        feedback: how the correction is fed back, see the module.
        half: whether the network computes in bfloat16; None chooses, see
            `palpate.correction.networks.unet_inference`.
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
        self._grid = self._grid_in(setup.geometry)
        self._around: tuple[Mesh, IntArray, FloatArray] | None = None
        self._following: ElasticExtension | None = None
        if feedback != "none" and self._grid is not None:
            mesh = even_mesh(setup, self._grid.nodes)
            points, shares = self._grid.between(mesh.nodes)
            used = (shares * self._used(trained)[points]).sum(axis=1)
            self._following = ElasticExtension(setup, mesh, np.flatnonzero(used > 0.5))

    def _grid_in(self, geometry: Geometry) -> EmbeddingGrid | None:
        """Return the grid of the network's points; None for a body that is not a grid."""
        grid = self.body.grid
        if grid is None:
            return None
        layers = round(geometry.size[2] / float(self.body.voxel[2])) + 1
        return EmbeddingGrid(geometry, (grid[0], grid[1], layers), self.body.flat)

    def _used(self, trained: TrainedNetwork) -> FloatArray:
        """Return 1 for points whose correction is used (n,): the top, or all that the camera
        sees.
        """
        if self.body.flat:
            return np.ones(self.body.count)
        seen = np.asarray(trained.about["seen"], dtype=float)[self.body.nodes]
        return np.asarray(hold_weights(seen) < 0.5, dtype=float)

    def correction(self, frame: Equilibrium, tool: FloatArray) -> FloatArray:
        """Return the correction of the body's points (v, 3) [m].

        Args:
            frame: the simulated frame.
            tool: (13,) as in the samples. Its force is replaced by the frame's, unless the network
                was trained with measured forces.
        """
        known = torch.as_tensor(tool, dtype=torch.float32)
        if not self.measured_force:
            known[10:] = torch.as_tensor(frame.force, dtype=torch.float32)
        simulated = torch.as_tensor(frame.move(self.body.rest), dtype=torch.float32)
        return np.asarray((self._network(simulated, known) - simulated).numpy(), dtype=float)

    def correct(self, frame: Equilibrium, tool: FloatArray) -> Equilibrium:
        """Return the frame with its shape corrected; everything else stays simulated."""
        moved = self.correction(frame, tool)[: self.body.count]
        if self._grid is None:
            if len(frame.mesh.nodes) != len(moved) or not np.allclose(
                frame.mesh.nodes, self.body.rest, atol=1e-9
            ):
                raise CorrectionError(
                    "the frame is of another mesh than the network was trained on; "
                    "replay on that one",
                    key="mesh",
                )
            return replace(frame, displacement=frame.displacement + moved)
        if self._following is None:
            change = self._onto(self._grid, frame.mesh, moved)
        else:
            mesh = self._following.mesh
            extended = self._following(self._onto(self._grid, mesh, moved))
            change = mesh.interpolate(extended, frame.mesh.nodes)
        return replace(frame, displacement=frame.displacement + change)

    def _onto(self, grid: EmbeddingGrid, mesh: Mesh, moved: FloatArray) -> FloatArray:
        """Return the correction (m, 3) [m] of a mesh's nodes of that of the grid (n, 3)."""
        if self._around is None or self._around[0] is not mesh:
            self._around = (mesh, *grid.between(mesh.nodes))
        return weighted_nodes(*self._around[1:], moved)


def _single(
    network: CorrectionNetwork, half: bool | None
) -> Callable[[torch.Tensor, torch.Tensor], torch.Tensor]:
    """Return the network as a function of vertices (v, 3) [m] and tool (13,) of one frame."""
    if network.spec.kind != "graph":
        return UNetInference(network, half)
    plain = network.cpu().eval()

    def single(vertices: torch.Tensor, tool: torch.Tensor) -> torch.Tensor:
        with torch.inference_mode():
            corrected: torch.Tensor = plain(vertices[None], tool[None])[0]
            return corrected

    return single


@dataclass(frozen=True, eq=False)
class CorrectedFrame:
    """A frame as simulated and as corrected.

    Attributes:
        raw: the simulated frame.
        corrected: the corrected frame.
    """

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
    """Yield the corrected frames of a replay one by one.

    A frame without equilibrium is yielded uncorrected.

    Args:
        corrector: corrects the frames.
        setup: the setup of the replay.
        centres: (f, 3) stated tool centres [m], phantom frame.
        tools: (f, 13) as in the samples.
        grid: the mesh protocol.
        times: (f,) times of the frames [s], for a material with history.
        tolerance: residual over the push force at which a frame counts as converged [1].
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
