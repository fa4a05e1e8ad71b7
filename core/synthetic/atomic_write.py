"""Atomic writing of a dataset and its truth."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from palpate.foundation.errors import RunError
from palpate.synthetic.scenario.truth_file import Truth, truth_path

__all__ = ["write_atomically"]


def write_atomically(folder: Path, fill: Callable[[Path], Truth]) -> Truth:
    """Fill a temporary folder, then move it to `folder` and write the truth beside it.

    Both appear whole or not at all. Raises RunError where `folder` exists.
    """
    if folder.exists():
        raise RunError(
            f"{folder} exists already; choose another name or remove it", path=str(folder)
        )
    folder.parent.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        truth = fill(aside)
        aside.chmod(0o755)
        truth.save(truth_path(folder))
        aside.rename(folder)
    except BaseException:
        shutil.rmtree(aside, ignore_errors=True)
        raise
    return truth
