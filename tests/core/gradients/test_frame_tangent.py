"""The factorised tangent of a frame."""

from __future__ import annotations

import numpy as np
from pushed_block import poke

from palpate.fem.model import BlockModel
from palpate.gradients.displacement_changes import displacement_changes
from palpate.gradients.setup_change import TOOL_STEP


def test_tangent_is_factorised_once_until_another_replaces_it(monkeypatch, pushed):
    block, frame = pushed
    steps = [(block.setup, TOOL_STEP * np.array([0.0, 0.0, 1.0]))]
    tangents, assemble = [], BlockModel.assemble

    def counted(self, positions, tool, *, tangent=True, bending=True):
        tangents.append(tangent)
        return assemble(self, positions, tool, tangent=tangent, bending=bending)

    monkeypatch.setattr(BlockModel, "assemble", counted)
    block.factorised = None
    first = displacement_changes(block, frame, steps)
    assert sum(tangents) == 1
    again = displacement_changes(block, frame, steps)
    assert sum(tangents) == 1 and np.array_equal(first, again)
    other = block.step(poke(3e-3), frame)
    made = sum(tangents)
    assert made > 1
    # A step of the replay condenses its tangent apart.
    assert np.array_equal(displacement_changes(block, frame, steps), first)
    assert sum(tangents) == made
    elsewhere = displacement_changes(block, other, steps)
    assert sum(tangents) == made + 1 and not np.allclose(elsewhere, first, rtol=1e-3)
    assert np.allclose(displacement_changes(block, frame, steps), first, rtol=1e-8, atol=1e-15)
    assert sum(tangents) == made + 2
