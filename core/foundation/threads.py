"""One thread for the small dense products of a solve.

A replay multiplies thousands of matrices of a few hundred rows a second. OpenBLAS hands each to
threads that wait for one another in a busy loop; on cores that also do other work such a replay
takes 20 to 40 times as long. Frames and sequences are what runs side by side, in processes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

_P = ParamSpec("_P")
_R = TypeVar("_R")


@cache
def _pools(with_mkl: bool) -> ThreadpoolController:
    """Of the libraries loaded by now: NumPy's and SciPy's always, MKL once a matrix was factorised
    with it.
    """
    return ThreadpoolController()


def on_one_thread(solve: Callable[_P, _R]) -> Callable[_P, _R]:
    """Bound BLAS to one thread for the length of each call; 9 us a call."""

    @wraps(solve)
    def bounded(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with _pools("pypardiso" in sys.modules).limit(limits=1, user_api="blas"):
            return solve(*args, **kwargs)

    return bounded
