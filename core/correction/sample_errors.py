"""Errors of a correction network on samples."""

from __future__ import annotations

import torch
from torch import Tensor

from palpate.correction.networks.architectures import CorrectionNetwork
from palpate.correction.networks.chamfer import SurfaceLoss
from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.sample_store import Samples
from palpate.foundation.arrays import IntArray

__all__ = ["sample_errors"]

_CHUNK = 256
"""Samples that are read at a time."""


@torch.no_grad()
def sample_errors(
    network: CorrectionNetwork | None,
    loss: SurfaceLoss,
    body: Body,
    samples: Samples,
    rows: IntArray,
    device: torch.device | str = "cpu",
) -> Tensor:
    """Return the mean distance [mm] of each sample's measured points to the corrected surface (n,).

    For a network over the top, of the points that are seen from above. Samples without such
    points are left out.

    Args:
        network: the network; None for the simulated surface.
        loss: gives the distances.
        body: the points that the network corrects.
        samples: the samples.
        rows: (n,) rows of the samples.
        device: where network and loss are.
    """
    errors = [torch.zeros(0)]
    for batch in samples.batches(rows, _CHUNK):
        here = batch.to(torch.device(device))
        vertices = here.positions[:, body.index]
        apart, valid = loss.distances(
            vertices if network is None else network(vertices, here.tool), here
        )
        errors.append((torch.where(valid, apart, 0.0).sum(dim=1) / valid.sum(dim=1)).cpu() * 1e3)
    whole = torch.cat(errors)
    return whole[torch.isfinite(whole)]
