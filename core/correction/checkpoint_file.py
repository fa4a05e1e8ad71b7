"""Checkpoint files, written atomically, and the random state that they hold."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import torch

from palpate.foundation.errors import RunError

__all__ = ["differing", "load", "random_state", "restore_random_state", "save", "save_json"]


def save(path: Path, content: dict[str, Any]) -> None:
    """Write tensors and plain values atomically."""
    aside = path.with_name(f".{path.name}-{uuid4().hex}")
    try:
        with aside.open("wb") as file:
            torch.save(content, file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def save_json(path: Path, value: Any) -> None:
    """Write plain values as JSON atomically, for readers without torch."""
    aside = path.with_name(f".{path.name}-{uuid4().hex}")
    aside.write_text(json.dumps(value))
    os.replace(aside, path)


def load(path: Path, device: torch.device | str = "cpu") -> dict[str, Any]:
    """Return what `save` wrote; code in the file is not executed.

    Raises RunError where the file is missing or damaged.
    """
    try:
        content = torch.load(path, map_location=device, weights_only=True)
    except FileNotFoundError:
        raise RunError(f"{path} is not there; train first", path=str(path)) from None
    except Exception as error:  # the unpickler raises many kinds
        raise RunError(
            f"{path} cannot be read ({type(error).__name__}: {error}); train again", path=str(path)
        ) from None
    if not isinstance(content, dict):
        raise RunError(
            f"{path} holds a {type(content).__name__}; expected a checkpoint", path=str(path)
        )
    return content


def random_state() -> dict[str, Any]:
    """Return torch's random state, of the CPU and of all CUDA devices."""
    return {
        "cpu": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state_all() if torch.cuda.is_available() else [],
    }


def restore_random_state(state: dict[str, Any]) -> None:
    """Set the random state that `random_state` returned."""
    torch.set_rng_state(state["cpu"].cpu())
    if state["cuda"] and torch.cuda.is_available():
        torch.cuda.set_rng_state_all([part.cpu() for part in state["cuda"]])


def differing(stored: dict[str, Any], expected: dict[str, Any], place: str = "") -> Iterator[str]:
    """Yield the names of values that differ, with the names of the tables that hold them."""
    for key, value in expected.items():
        name, before = f"{place}{key}", stored.get(key)
        if isinstance(value, dict) and isinstance(before, dict):
            yield from differing(before, value, f"{name}.")
        elif before != value:
            yield name
