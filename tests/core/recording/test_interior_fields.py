"""Interior fields of a recording; tests/core/recording/test_resolve_frame.py compares them with a
real one.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.interior_fields import InteriorFields, trilinear
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)


@pytest.fixture(scope="module")
def pushed() -> tuple[Setup, InteriorFields]:
    """A block that is 2 % longer than stated: untouched, then 4 mm deep."""
    longer = Setup(
        geometry=Box(size=(1.02 * SIZE[0], *SIZE[1:])),
        registered=Box(size=SIZE),
        tool=Tool(radius=5e-3),
    )
    centres = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, SIZE[2] + 1e-3]])
    return longer, InteriorFields.of(longer, replay(longer, centres, PAGE_GRID))


def test_another_size_counts_as_displacement_from_the_stated_position(
    pushed: tuple[Setup, InteriorFields],
) -> None:
    moved = pushed[1].displacement(0, np.array([[SIZE[0] / 2, 0.0, 0.01], [0.0, 0.0, 0.01]]))
    assert moved[0] == pytest.approx([0.01 * SIZE[0], 0.0, 0.0], rel=1e-3, abs=1e-9)
    assert moved[1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)


def test_material_below_the_tool_moves_down_with_it_and_less_the_deeper(
    pushed: tuple[Setup, InteriorFields],
) -> None:
    below = np.array([[0.0, 0.0, height] for height in (SIZE[2], 0.025, 0.015, 0.0)])
    down = -pushed[1].displacement(1, below)[:, 2]
    assert down[0] == pytest.approx(4e-3, rel=0.02)
    assert np.all(np.diff(down) < 0) and down[-1] == 0.0


def test_fields_survive_a_file(pushed: tuple[Setup, InteriorFields], tmp_path) -> None:
    np.savez(tmp_path / "kept.npz", **pushed[1].arrays("raw"))
    with np.load(tmp_path / "kept.npz") as stored:
        found, missing = InteriorFields.read(stored, "raw"), InteriorFields.read(stored, "extended")
    assert missing is None and found is not None
    places = np.random.default_rng(1).uniform(-0.01, 0.03, (20, 3))
    for frame in (0, 1):
        assert np.array_equal(
            found.displacement(frame, places), pushed[1].displacement(frame, places)
        )
        assert np.array_equal(
            found.energy_density(frame, places), pushed[1].energy_density(frame, places)
        )


def test_linear_fields_are_interpolated_exactly() -> None:
    rng = np.random.default_rng(0)
    axes = [np.sort(rng.uniform(0, 1, count)) for count in (5, 4, 3)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    places = np.column_stack([rng.uniform(axis[0], axis[-1], 20) for axis in axes])
    found = trilinear(axes, 2 * x - 3 * y + z + 1, places)
    assert found == pytest.approx(places @ [2.0, -3.0, 1.0] + 1)
