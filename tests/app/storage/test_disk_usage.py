from __future__ import annotations

import os
from pathlib import Path

from palpate.app.storage.disk_usage import CACHES, Disk


def write(path: Path, size: int, used: float) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"x" * size)
    os.utime(path, (used, used))
    return path


def test_the_oldest_caches_go_first_and_results_never(tmp_path: Path) -> None:
    result = write(tmp_path / "run" / "report.json", 5000, 1.0)
    old, middle, new = (
        write(tmp_path / CACHES[0] / "ab" / f"{name}.json", 1000, at)
        for name, at in (("a", 10), ("b", 20), ("c", 30))
    )
    spared = write(tmp_path / CACHES[2] / "waiting.archive", 1000, 5.0)
    disk = Disk(tmp_path, 7500)
    assert (disk.usage().used, disk.usage().caches) == (9000, 4000)
    now = disk.trim(spared=frozenset({str(spared)}))
    assert (now.used, now.dropped) == (7000, 2000)
    assert [path.exists() for path in (result, old, middle, new, spared)] == [
        True,
        False,
        False,
        True,
        True,
    ]
    now = Disk(tmp_path, 100).trim(spared=frozenset({str(spared)}))
    assert now.used == 6000 and result.exists() and not new.exists()
    assert Disk(tmp_path / "none", 100).trim().used == 0
