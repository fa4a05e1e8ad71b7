"""An import whose files take too much memory to read."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from small_dataset import write_valid_dataset

from palpate.app.jobs import import_dataset as importing
from palpate.foundation.errors import DatasetError


def test_import_that_takes_too_much_memory_is_refused_and_leaves_no_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    table = folder / "sequences" / "poke-01" / "forces.csv"
    rows = (f"{100 + number / 1e6:.6f},0.0,0.0,0.1" for number in range(600_000))
    table.write_text("\n".join(["t,fx,fy,fz", *rows]))
    archive = Path(shutil.make_archive(str(tmp_path / "sent"), "zip", tmp_path, "block"))
    request = {
        "datasets": str(tmp_path / "datasets"),
        "name": "large",
        "scratch": str(tmp_path / "scratch"),
        "archive": str(archive),
        "most": 2**30,
    }
    monkeypatch.setattr(importing, "_MEMORY", 2**22)
    with pytest.raises(DatasetError, match="take more than 4 MiB of memory"):
        importing.import_dataset(request, lambda *_: None)
    assert not (tmp_path / "datasets" / "large").exists() and not archive.exists()
