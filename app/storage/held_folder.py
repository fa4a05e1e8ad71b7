"""Folders of unfinished work that several servers may have below one parent.

A process holds its folder by a lock that ends with it. So what was left behind is told from what
another server works on, whatever the names.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

__all__ = ["drop_left_behind", "held_folder"]


@contextlib.contextmanager
def held_folder(folder: Path) -> Iterator[Path]:
    """Make a folder and hold it in the block; it is not deleted at the end.

    Raises OSError where it cannot be made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as held:
        with _locked(folder.parent):  # nobody looks between the two steps
            folder.mkdir(exist_ok=True)
            held.enter_context(_locked(folder))
        yield folder


def drop_left_behind(parent: Path) -> None:
    """Delete the folders below `parent` that no process holds; without one, or where nothing can
    be written, nothing happens.
    """
    with contextlib.suppress(OSError), _locked(parent):
        for folder in parent.iterdir():
            with contextlib.suppress(OSError), _locked(folder, fcntl.LOCK_NB):
                shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _locked(folder: Path, more: int = 0) -> Iterator[None]:
    """Lock a folder; with LOCK_NB in `more`, raise BlockingIOError where another process has it."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | more)
        yield
    finally:
        os.close(opened)
