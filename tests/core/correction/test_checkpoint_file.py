"""Files of networks come from elsewhere, too: no code in them is executed."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from palpate.foundation.errors import RunError

torch = pytest.importorskip("torch")

from palpate.correction.checkpoint_file import load  # noqa: E402


class Attack:
    """Its unpickling makes a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.folder),)


def test_code_in_a_checkpoint_is_refused_and_not_executed(tmp_path: Path) -> None:
    torch.save({"weights": Attack(tmp_path / "attacked")}, tmp_path / "network.pt")
    with pytest.raises(RunError, match=r"network\.pt cannot be read"):
        load(tmp_path / "network.pt")
    assert not (tmp_path / "attacked").exists()


def test_file_that_is_no_checkpoint_is_told(tmp_path: Path) -> None:
    torch.save([1, 2], tmp_path / "list.pt")
    with pytest.raises(RunError, match="holds a list; expected a checkpoint"):
        load(tmp_path / "list.pt")
    (tmp_path / "damaged.pt").write_bytes(b"PK\x03\x04 damaged")
    with pytest.raises(RunError, match="cannot be read"):
        load(tmp_path / "damaged.pt")
    with pytest.raises(RunError, match="is not there"):
        load(tmp_path / "missing.pt")
