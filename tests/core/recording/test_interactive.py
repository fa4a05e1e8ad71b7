"""Interactive replay: the response equals that of a replay at the same position."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.interactive import DEEPEST, InteractiveReplay
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)
RADIUS = 5e-3
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=RADIUS))
ABOVE = np.array([0.0, 0.0, SIZE[2] + 2 * RADIUS])


@pytest.fixture(scope="module")
def live() -> InteractiveReplay:
    return InteractiveReplay(SETUP, PAGE_GRID)


def pushed(depth: float, x: float = 0.0) -> np.ndarray:
    return np.array([x, 0.0, SIZE[2] + RADIUS - depth])


def test_answer_is_that_of_a_replay_and_no_point_lies_in_the_tool(live: InteractiveReplay) -> None:
    live.at(ABOVE)
    live.at(pushed(0.002, -0.003))
    felt = live.at(pushed(0.004), within=True)
    (frame,) = replay(SETUP, pushed(0.004)[None], PAGE_GRID, tolerance=1e-3)
    assert felt.converged and felt.outcome == "converged"
    assert felt.depth == pytest.approx(0.004, abs=1e-9)
    assert felt.force == pytest.approx(frame.force, abs=0.02 * float(np.linalg.norm(frame.force)))
    assert felt.force[2] > 0
    assert np.linalg.norm(felt.surface - felt.tool, axis=1).min() > RADIUS - 5e-5
    assert felt.inside is not None
    down = felt.inside.displacement(0, np.array([[0.0, 0.0, SIZE[2]]]))[0, 2]
    assert down == pytest.approx(-0.004, rel=0.02)


def test_lifted_tool_has_no_force(live: InteractiveReplay) -> None:
    live.at(pushed(0.003))
    felt = live.at(ABOVE)
    assert felt.depth == 0.0 and not felt.force.any() and felt.inside is None
    assert np.isnan(felt.error).all()


@pytest.mark.parametrize(
    ("wanted", "reached"),
    [
        ((0.0, 0.0, 0.02), (0.0, 0.0, SIZE[2] + RADIUS - DEEPEST * SIZE[2])),
        ((0.027, 0.0, 0.012), (SIZE[0] / 2 + RADIUS - DEEPEST * SIZE[2], 0.0, 0.012)),
        ((0.0, 0.5, -1.0), (0.0, SIZE[1] / 2 + 0.06, RADIUS)),
        ((0.0, 0.0, 0.06), (0.0, 0.0, 0.06)),
    ],
)
def test_tool_stops_at_its_permitted_range(
    live: InteractiveReplay, wanted: tuple[float, ...], reached: tuple[float, ...]
) -> None:
    assert live.reachable(np.array(wanted)) == pytest.approx(reached, abs=1e-9)


def test_frame_without_equilibrium_is_reported_and_shows_the_last_one() -> None:
    """A tool whose tip is lower than stated runs into the held edge of the base."""
    live = InteractiveReplay(
        Setup(geometry=Box(size=SIZE), tool=Tool(radius=RADIUS, offset=(0.0, 0.0, -2e-3))),
        PAGE_GRID,
    )
    beside = np.array([SIZE[0] / 2 + RADIUS - 1e-3, 0.0, 0.02])
    before = live.at(beside)
    felt = live.at(np.array([SIZE[0] / 2 + 2e-3, 0.0, RADIUS]))
    assert before.converged and not felt.converged
    assert "base" in felt.outcome
    assert np.array_equal(felt.surface, before.surface)
    assert live.at(beside).converged
