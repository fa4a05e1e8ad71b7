"""An import whose files take too much memory to read."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

from small_dataset import write_valid_dataset

_IMPORT = """
import json, sys
from palpate.app.jobs import import_dataset as importing
from palpate.foundation.errors import DatasetError

importing._MEMORY = 2**22
try:
    importing.import_dataset(json.loads(sys.argv[1]), lambda *_: None)
except DatasetError as error:
    print(error)
"""


def test_import_that_takes_too_much_memory_is_refused_and_leaves_no_dataset(tmp_path: Path) -> None:
    """The import runs in a process of its own: one that ran other tests holds freed memory, from
    which it would read the table without taking more.
    """
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
    run = subprocess.run(
        [sys.executable, "-c", _IMPORT, json.dumps(request)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "take more than 4 MiB of memory" in run.stdout, run.stderr
    assert not (tmp_path / "datasets" / "large").exists() and not archive.exists()
