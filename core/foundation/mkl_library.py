"""The place of Intel's MKL, for pypardiso."""

from __future__ import annotations

import os
import sys
from pathlib import Path

__all__ = ["name_library"]


def name_library() -> None:
    """Tell pypardiso where MKL is; call it before pypardiso is imported.

    It would search the whole environment for it, for one to three seconds in each process.
    """
    beside = sorted((Path(sys.prefix) / "lib").glob("libmkl_rt.so*"))
    if beside:
        os.environ.setdefault("PYPARDISO_MKL_RT", str(beside[0]))
