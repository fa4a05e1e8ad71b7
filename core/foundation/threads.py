"""One BLAS thread for the small dense products of a solve.

A replay multiplies thousands of matrices of a few hundred rows a second. OpenBLAS gives each to
threads that wait for one another in a busy loop; on cores that also do other work such a replay
takes 20 to 40 times as long. Frames and sequences run in parallel in processes instead.
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
    """The thread pools of the libraries loaded so far.

    NumPy's and SciPy's are always loaded, MKL's once a matrix was factorised with it.
    """
    return ThreadpoolController()


def on_one_thread(solve: Callable[_P, _R]) -> Callable[_P, _R]:
    """Limit BLAS to one thread for the length of each call; costs 9 us a call."""

    @wraps(solve)
    def bounded(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with _pools("pypardiso" in sys.modules).limit(limits=1, user_api="blas"):
            return solve(*args, **kwargs)

    return bounded
