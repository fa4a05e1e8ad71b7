"""A replay uses one thread, whatever the limit, and restores the limit."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Setup, Tool

SETUP = Setup(geometry=Box(size=(0.0687, 0.0393, 0.0358)), tool=Tool(radius=5e-3), mass=0.104)


def _threads(pools: ThreadpoolController) -> set[int]:
    """Numbers of threads of the libraries that a replay calls; other tests may have loaded more."""
    ours = [
        pool
        for pool in pools.info()
        if any(name in pool["filepath"] for name in ("scipy_openblas", "mkl_rt"))
    ]
    return {pool["num_threads"] for pool in ours}


def test_replay_uses_one_thread_and_restores_the_others() -> None:
    grid, push = GridSpec(nodes=(5, 3, 3)), np.array([[0, 0, 0.1], [0, 0, 0.0395]])
    replay(SETUP, push, grid)  # now all is loaded that a replay calls
    pools, seen = ThreadpoolController(), []
    with pools.limit(limits=2, user_api="blas"):
        if _threads(pools) != {2}:
            pytest.skip("BLAS of this machine takes no second thread")
        replay(SETUP, push, grid, report=lambda *_: seen.append(_threads(pools)))
        assert seen == [{1}, {1}]
        assert _threads(pools) == {2}


PUSHES = """
import numpy as np
from pushed_block import SETUP, poke
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.interactive import InteractiveReplay

live = InteractiveReplay(SETUP, PAGE_GRID.for_tool(SETUP.tool.radius))
depths = (-1e-3, 1e-3, 2e-3, 4e-3, 3e-3, 5e-3)
print(all(live.at(np.array(poke(depth))).converged for depth in depths))
"""


def test_factors_are_valid_if_mkl_may_use_several_threads() -> None:
    here = Path(__file__).parents[3]
    known = {
        **os.environ,
        "MKL_NUM_THREADS": "2",
        "PYTHONPATH": os.pathsep.join([str(here), str(here / "tests")]),
    }
    done = subprocess.run(
        [sys.executable, "-c", PUSHES], env=known, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, "True"), done.stderr
