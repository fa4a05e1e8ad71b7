"""A minute of palpation at 30 Hz, as in the benchmark: every frame has an equilibrium."""

from __future__ import annotations

import numpy as np

from benchmarks.reference_pokes import SETUP
from benchmarks.replay import RATE, motion
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay, require_converged


def test_every_frame_of_a_minute_finds_its_equilibrium() -> None:
    frames = replay(SETUP, motion(), GridSpec(nodes=(13, 5, 5)))
    assert len(frames) == 60 * RATE
    require_converged(frames)
    assert max(frame.residual for frame in frames) <= 1e-6
    touched = np.array([frame.in_contact for frame in frames])
    assert 0.6 < touched.mean() < 0.9
    assert max(np.linalg.norm(frame.force) for frame in frames) > 0.3
    assert all(np.linalg.norm(frame.force) == 0 for frame in frames if not frame.in_contact)
