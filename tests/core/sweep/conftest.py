"""A small virtual phantom whose tool is larger than stated."""

from __future__ import annotations

from pathlib import Path

import pytest
from swept import write_swept_phantom


@pytest.fixture(scope="session")
def phantom(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pushes from above by a ball of 6 mm that is stated to have 5 mm."""
    return write_swept_phantom(tmp_path_factory.mktemp("sweep") / "phantom")
