"""Network architectures: U-Nets over the top or the volume, and a graph network on any mesh.

The U-Nets are those of Wu, Kazanzides and Unberath (2020).

All take vertices (b, v, 3) [m] and tool inputs (b, t), and return corrected vertices. The output
passes through tanh and is bounded to `trust` voxels along each axis, so that a network can correct
the simulation but not replace it. The last layer starts at zero: an untrained network does not
change the simulation.

The graph network is in plain torch. It needs one gather and one sum over neighbours (`index_add`),
which torch has on all devices, also in a deterministic form; torch-geometric would add four
packages for these two lines.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, Self, get_args

import numpy as np
import torch
from torch import Tensor, nn

from palpate.correction.networks.unet import UNet
from palpate.correction.samples.corrected_points import Body
from palpate.foundation.errors import CorrectionError

__all__ = ["TOOL_INPUTS", "CorrectionNetwork", "GraphNet", "NetworkSpec", "build"]

Kind = Literal["unet2d", "unet3d", "graph"]
TOOL_INPUTS: dict[str, tuple[int, ...]] = {
    "pose": tuple(range(7)),
    "velocity": (7, 8, 9),
    "force": (10, 11, 12),
}
"""Columns of the samples' tool array: position [m] and quaternion, velocity [m/s], contact force
[N]; phantom frame."""


@dataclass(frozen=True, kw_only=True)
class NetworkSpec:
    """The specification of a network.

    Attributes:
        kind: "unet2d" over the top, "unet3d" over the volume, or "graph" over the edges of
            any mesh.
        features: features of the blocks from fine to coarse. A graph network has the last number of
            features and as many message rounds as there are blocks.
        trust: bound of the correction along each axis [voxels].
        inputs: the tool inputs, names of TOOL_INPUTS.
    """

    kind: Kind = "unet2d"
    features: tuple[int, ...] = (64, 128, 256)
    trust: float = 0.5
    inputs: tuple[str, ...] = ("pose",)

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise CorrectionError(
                f"kind = {self.kind!r}; expected one of {', '.join(get_args(Kind))}",
                key="kind",
                value=self.kind,
            )
        if not self.features or min(self.features) < 1:
            raise CorrectionError(
                f"features = {self.features}; expected positive numbers", key="features"
            )
        if not 0 < self.trust <= 10:
            raise CorrectionError(
                f"trust = {self.trust:g} voxels; expected 0 to 10", key="trust", value=self.trust
            )
        for name in self.inputs:
            if name not in TOOL_INPUTS:
                raise CorrectionError(
                    f"input {name!r}; expected one of {', '.join(TOOL_INPUTS)}",
                    key="inputs",
                    value=name,
                )

    @property
    def columns(self) -> list[int]:
        """Columns of the tool array that the network reads."""
        return [column for name in self.inputs for column in TOOL_INPUTS[name]]

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "features": list(self.features), "inputs": list(self.inputs)}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Self:
        """Return the specification that `to_json` wrote; missing keys have their defaults."""
        plain: dict[str, Any] = {
            **data,
            **{key: tuple(data[key]) for key in ("features", "inputs") if key in data},
        }
        return cls(**plain)


class GraphNet(nn.Module):
    """Message passing along edges (Battaglia et al. 2018).

    A message is the rectified sum of linear maps of both ends and of the edge. A vertex is updated
    from the mean of its messages. All matrix products are over vertices, of which there are a fifth
    as many as edges.

    Args:
        vertex: number of input features of a vertex.
        edge: number of input features of an edge.
        features: number of features of a vertex's state.
        rounds: number of message rounds.
    """

    def __init__(self, vertex: int, edge: int, features: int, rounds: int) -> None:
        super().__init__()
        self.first = nn.Sequential(nn.Linear(vertex, features), nn.ReLU())
        self.rounds = nn.ModuleList(_Round(features, edge) for _ in range(rounds))
        self.last = nn.Linear(features, 3)

    def forward(self, vertices: Tensor, along: Tensor, edges: Tensor, share: Tensor) -> Tensor:
        """Return the output (b, v, 3).

        Args:
            vertices: (b, v, n) features of the vertices.
            along: (b, e, m) features of the edges.
            edges: (2, e) ends of the edges.
            share: (v, 1) one over the number of neighbours.
        """
        state = self.first(vertices)
        for step in self.rounds:
            state = state + step(state, along, edges, share)
        return torch.as_tensor(self.last(state))


class _Round(nn.Module):
    def __init__(self, features: int, edge: int) -> None:
        super().__init__()
        self.source, self.target = (
            nn.Linear(features, features),
            nn.Linear(features, features, bias=False),
        )
        self.edge = nn.Linear(edge, features, bias=False)
        self.update = nn.Sequential(
            nn.Linear(2 * features, features), nn.ReLU(), nn.Linear(features, features)
        )

    def forward(self, state: Tensor, along: Tensor, edges: Tensor, share: Tensor) -> Tensor:
        source, target = (
            part(state).index_select(1, end)
            for part, end in zip((self.source, self.target), edges, strict=True)
        )
        sent = torch.relu(source + target + self.edge(along))
        received = torch.zeros_like(state).index_add(1, edges[1], sent.to(state.dtype)) * share
        return torch.as_tensor(self.update(torch.cat([state, received], dim=2)))


class CorrectionNetwork(nn.Module):
    """A network that corrects the vertices of one body, given the tool.

    It computes the correction of the body's nodes; further points of the body follow them.

    The tool's position is normalised by the body's extent. Displacement, velocity and force are
    normalised by their RMS in the samples (`set_input_scales`), which is saved with the weights.
    The position is not, because pushes at one place have almost no spread.

    Args:
        spec: the architecture.
        body: the points that are corrected.
    """

    rest: Tensor
    bound: Tensor
    tool_middle: Tensor
    tool_scale: Tensor
    spread: Tensor
    place: Tensor
    extent: Tensor
    edges: Tensor
    share: Tensor
    along: Tensor
    carriers: Tensor
    carried: Tensor

    def __init__(self, spec: NetworkSpec, body: Body) -> None:
        super().__init__()
        self.spec, self.grid, self._columns = spec, body.grid, spec.columns
        count, rest = len(spec.columns), body.rest[: body.count]
        middle, half = rest.mean(axis=0), np.maximum(np.ptp(rest, axis=0) / 2, body.voxel)
        self._add_buffer("rest", rest)
        self._add_buffer("bound", spec.trust * body.voxel)
        self._add_buffer("place", (rest - middle) / half)
        self._add_buffer("extent", half)
        self._add_buffer("tool_middle", np.concatenate([middle, np.zeros(10)])[spec.columns])
        self._add_buffer(
            "tool_scale",
            np.concatenate([half, np.ones(4), np.full(3, 0.01), np.ones(3)])[spec.columns],
        )
        self._add_buffer("spread", np.array(float(body.voxel.mean()) / 4))
        carriers = torch.as_tensor(body.carriers.astype(np.int64))
        self.register_buffer("carriers", carriers, persistent=False)
        carried = torch.as_tensor(body.carried, dtype=torch.float32)
        self.register_buffer("carried", carried, persistent=False)
        self.inside: UNet | GraphNet
        if spec.kind == "graph":
            neighbours = np.bincount(body.edges[1], minlength=len(rest))
            self.register_buffer(
                "edges", torch.as_tensor(body.edges.astype(np.int64)), persistent=False
            )
            self._add_buffer("share", 1.0 / np.maximum(neighbours, 1)[:, None])
            lengths = np.linalg.norm(rest[body.edges[0]] - rest[body.edges[1]], axis=1)
            self._add_buffer("along", lengths[:, None] / half.mean())
            # Displacement, position at rest, vector to the tool, and tool inputs.
            self.inside = GraphNet(3 + 3 + 3 + count, 4, spec.features[-1], len(spec.features))
        else:
            self.inside = UNet(body.grid or (), 3, count, spec.features)
        for parameter in self.inside.last.parameters():
            nn.init.zeros_(parameter)

    def _add_buffer(self, name: str, values: Any) -> None:
        self.register_buffer(name, torch.as_tensor(np.asarray(values, dtype=np.float32)))

    def set_input_scales(self, velocity: float, force: float, displacement: float) -> None:
        """Set the normalisation of the inputs.

        Args:
            velocity: RMS of the tool's velocity along an axis [m/s].
            force: RMS of its force along an axis [N].
            displacement: RMS of the points' displacement along an axis [m].
        """
        scale = self.tool_scale.new_ones(13)
        scale[self._columns] = self.tool_scale
        scale[7:10], scale[10:] = max(velocity, 1e-4), max(force, 1e-9)
        self.tool_scale.copy_(scale[self._columns])
        self.spread.fill_(max(displacement, 1e-5))

    def forward(self, vertices: Tensor, tool: Tensor) -> Tensor:
        """Return the corrected vertices (b, v, 3) [m] of simulated ones.

        Args:
            vertices: (b, v, 3) simulated vertices [m].
            tool: (b, 13) tool array, see TOOL_INPUTS.
        """
        nodes = vertices[:, : len(self.rest)]
        moved = (nodes - self.rest) / self.spread
        known = (tool[:, self._columns] - self.tool_middle) / self.tool_scale
        output = (
            self._graph(nodes, moved, tool, known)
            if self.grid is None or self.spec.kind == "graph"
            else self._grid(moved, known)
        )
        return vertices + self.carry(torch.tanh(output.to(vertices.dtype)) * self.bound)

    def carry(self, change: Tensor) -> Tensor:
        """Return the correction (b, v, 3) [m] of all points of that of the nodes (b, n, 3)."""
        if not len(self.carriers):
            return change
        near = change.index_select(1, self.carriers.flatten())
        further = near.reshape(len(change), *self.carriers.shape, 3) * self.carried[..., None]
        return torch.cat([change, further.sum(dim=2)], dim=1)

    def _grid(self, moved: Tensor, known: Tensor) -> Tensor:
        axes = len(self.grid or ())
        volume = moved.reshape(len(moved), *reversed(self.grid or ()), 3)
        order = (0, axes + 1, *range(axes, 0, -1))
        back = (0, *range(axes + 1, 1, -1), 1)
        output: Tensor = self.inside(volume.permute(order), known)
        return output.permute(back).reshape(moved.shape)

    def _graph(self, vertices: Tensor, moved: Tensor, tool: Tensor, known: Tensor) -> Tensor:
        to_tool = (tool[:, None, :3] - vertices) / self.extent
        everywhere = known[:, None].expand(-1, vertices.shape[1], -1)
        place = self.place.expand(len(vertices), -1, -1)
        strain = moved.index_select(1, self.edges[0]) - moved.index_select(1, self.edges[1])
        along = torch.cat([strain, self.along.expand(len(vertices), -1, -1)], dim=2)
        output: Tensor = self.inside(
            torch.cat([moved, place, to_tool, everywhere], dim=2), along, self.edges, self.share
        )
        return output


def build(spec: NetworkSpec, body: Body, seed: int = 0) -> CorrectionNetwork:
    """Return a network with first weights that depend on the seed only.

    Raises CorrectionError where the kind does not fit the body.
    """
    axes = {"unet2d": 2, "unet3d": 3}.get(spec.kind)
    if axes is not None and (body.grid is None or len(body.grid) != axes):
        shape = "no grid" if body.grid is None else f"a grid of {len(body.grid)} axes"
        raise CorrectionError(
            f"{spec.kind} corrects a grid of {axes} axes, this body is {shape}; take kind graph",
            key="kind",
        )
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return CorrectionNetwork(spec, body)
