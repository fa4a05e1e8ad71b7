"""Torch devices, and reproducible computation on them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import torch

from palpate.foundation.errors import CorrectionError

__all__ = ["device_of", "reproducible"]


def device_of(name: str) -> torch.device:
    """Return the device of a name ("cpu", "cuda:1"); "auto" is CUDA where it is available.

    Raises CorrectionError for a device that is not available.
    """
    here = ["cpu", *(f"cuda:{index}" for index in range(torch.cuda.device_count()))]
    if name == "auto":
        return torch.device(here[-1] if len(here) == 1 else "cuda:0")
    device = "cuda:0" if name == "cuda" else name
    if device not in here:
        raise CorrectionError(
            f"there is no device {name!r} here; there is {', '.join(here)}",
            key="device",
            value=name,
        )
    return torch.device(device)


@contextmanager
def reproducible(device: torch.device, seed: int, threads: int | None = None) -> Iterator[None]:
    """Seed torch and make it deterministic, on this many threads; restore its state afterwards."""
    count, strict, cudnn = (
        torch.get_num_threads(),
        torch.are_deterministic_algorithms_enabled(),
        torch.backends.cudnn.benchmark,
    )
    on = [device] if device.type == "cuda" else []
    with torch.random.fork_rng(devices=on):
        try:
            if device.type == "cuda":
                # cuBLAS is deterministic only with this workspace, which it reads when it starts.
                os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
                torch.backends.cudnn.benchmark = False
                torch.use_deterministic_algorithms(True)
            if threads is not None:
                torch.set_num_threads(threads)
            torch.manual_seed(seed)
            yield
        finally:
            torch.use_deterministic_algorithms(strict)
            torch.backends.cudnn.benchmark = cudnn
            torch.set_num_threads(count)
