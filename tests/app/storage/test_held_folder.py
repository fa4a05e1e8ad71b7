"""Folders of unfinished work below one parent, of several servers."""

from __future__ import annotations

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from job_functions import TARGETS

from palpate.app.jobs.import_dataset import import_dataset
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.storage.held_folder import drop_left_behind, held_folder
from palpate.foundation.errors import DatasetError

HOLDER = """
import pathlib, sys
from palpate.app.storage.held_folder import held_folder
with held_folder(pathlib.Path(sys.argv[1])) as folder:
    (folder / "half").write_text("done")
    print("held", flush=True)
    sys.stdin.read()
"""


def test_work_of_another_server_stays_and_what_a_killed_one_left_goes(tmp_path: Path) -> None:
    parent = tmp_path / "datasets" / ".importing"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(parent / "one")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
        (parent / "left").mkdir()
        with closing(JobQueue(tmp_path / "other-runs", TARGETS, beside=[parent])):
            assert [one.name for one in parent.iterdir()] == ["one"]
            assert (parent / "one" / "half").is_file()
        holder.kill()
        holder.wait()
        drop_left_behind(parent)
        assert not list(parent.iterdir())


def test_folder_is_no_longer_held_after_the_block(tmp_path: Path) -> None:
    with held_folder(tmp_path / "parent" / "one") as folder:
        drop_left_behind(folder.parent)
        assert folder.is_dir()
    drop_left_behind(tmp_path / "parent")
    assert not (tmp_path / "parent" / "one").exists()


def test_nothing_is_dropped_without_a_folder_and_none_is_made_where_nobody_may_write(
    tmp_path: Path,
) -> None:
    drop_left_behind(tmp_path / "missing")
    request = {
        "datasets": "/proc/self",
        "name": "new",
        "scratch": str(tmp_path / "scratch"),
        "folder": str(tmp_path),
        "most": 1000,
    }
    with pytest.raises(DatasetError, match="no dataset can be imported into /proc/self"):
        import_dataset(request, lambda *_: None)
