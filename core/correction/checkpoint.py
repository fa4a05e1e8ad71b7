"""A training on disk: everything it needs to go on as if it had never been stopped, written aside
and renamed into place.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any
from uuid import uuid4

import torch

from palpate.foundation.errors import RunError

__all__ = ["load", "save_json", "random_state", "restore_random_state", "save"]


def save(path: Path, content: dict[str, Any]) -> None:
    """Write tensors and plain values: the old file or the new one is there at any moment, whole."""
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
    """Write plain values for readers without torch, whole at any moment."""
    aside = path.with_name(f".{path.name}-{uuid4().hex}")
    aside.write_text(json.dumps(value))
    os.replace(aside, path)


def load(path: Path, device: torch.device | str = "cpu") -> dict[str, Any]:
    """What `save` wrote; only tensors and plain values are read, no code. RunError where it is
    missing or damaged.
    """
    try:
        content = torch.load(path, map_location=device, weights_only=True)
    except FileNotFoundError:
        raise RunError(f"{path} is not there; train first", path=str(path)) from None
    except Exception as error:  # torch raises whatever its unpickler does
        raise RunError(
            f"{path} cannot be read ({type(error).__name__}: {error}); train again", path=str(path)
        ) from None
    if not isinstance(content, dict):
        raise RunError(
            f"{path} holds a {type(content).__name__}; expected a checkpoint", path=str(path)
        )
    return content


def random_state() -> dict[str, Any]:
    """Of torch, on the processor and all CUDA devices."""
    return {
        "cpu": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state_all() if torch.cuda.is_available() else [],
    }


def restore_random_state(state: dict[str, Any]) -> None:
    """The inverse."""
    torch.set_rng_state(state["cpu"].cpu())
    if state["cuda"] and torch.cuda.is_available():
        torch.cuda.set_rng_state_all([part.cpu() for part in state["cuda"]])
