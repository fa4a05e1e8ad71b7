"""A small virtual phantom whose tool is larger than stated."""

from __future__ import annotations

from pathlib import Path

import pytest

from core.synthetic import HiddenEffect, Scenario, make_dataset


@pytest.fixture(scope="session")
def phantom(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pushes from above by a ball of 6 mm that is stated to have 5 mm."""
    folder = tmp_path_factory.mktemp("sweeping") / "phantom"
    hidden = HiddenEffect("tool_radius", {"radius": 6e-3})
    make_dataset(folder, Scenario(effects=(hidden,), sequences=("poke-top-01",)), 3)
    return folder
