"""A pressed block for all tests of gradients."""

from __future__ import annotations

import pytest
from pushed_block import GRID, SETUP, poke

from palpate.replay.replay import Equilibrium, Replay

TIGHT = 1e-10


@pytest.fixture(scope="module")
def pushed() -> tuple[Replay, Equilibrium]:
    """A ball pressed in by 4 mm, solved to the last digits."""
    block = Replay(SETUP, GRID, TIGHT)
    return block, block.step(poke(4e-3), block.step(poke(2e-3)))
