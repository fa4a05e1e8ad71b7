"""Archives of a megabyte that would unpack to gigabytes: refused, with little memory and time."""

from __future__ import annotations

import gzip
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

HUGE = 600 * 2**20
MEASURED = """
import pathlib, resource, sys
from palpate.app.storage.archive import unpack
from palpate.app.storage.archive_reader import is_archive
from palpate.foundation.errors import DatasetError
idle = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
archive = pathlib.Path(sys.argv[1])
print(is_archive(archive))
try:
    unpack(archive, archive.with_name("into"), 2**34)
except DatasetError as error:
    print(error)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - idle) / 1024)
"""


def header_bomb(path: Path, kind: bytes) -> Path:
    """A tar whose first header is 600 MB of a name."""
    info = tarfile.TarInfo("././@LongLink")
    info.type, info.size = kind, HUGE
    with gzip.open(path, "wb", compresslevel=1) as sink:
        sink.write(info.tobuf(tarfile.USTAR_FORMAT))
        for _ in range(HUGE // 2**20):
            sink.write(b"a" * 2**20)
    return path


def zip_bomb(path: Path) -> Path:
    """A zip whose table is 600 MB of line ends."""
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("block/dataset.toml", "w", force_zip64=True) as sink,
    ):
        for _ in range(HUGE // 2**20):
            sink.write(b"\n" * 2**20)
    return path


@pytest.mark.parametrize(
    ("bomb", "told"),
    [
        ("pax", "a name or attribute in the archive has 629145600 bytes; at most 65536"),
        ("gnu", "a name or attribute in the archive has 629145600 bytes; at most 65536"),
        ("zip", r"unpacked it is 600.0 MiB or more; at most "),
    ],
)
def test_bomb_is_refused_with_little_memory(tmp_path: Path, bomb: str, told: str) -> None:
    kinds = {"pax": tarfile.XHDTYPE, "gnu": tarfile.GNUTYPE_LONGNAME}
    path = tmp_path / "bomb"
    archive = zip_bomb(path) if bomb == "zip" else header_bomb(path, kinds[bomb])
    assert archive.stat().st_size < 8 * 2**20
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, str(archive)], capture_output=True, text=True, check=True
    )
    recognised, message, taken = done.stdout.strip().split("\n")
    assert recognised == "True" and told in message
    assert float(taken) < 100, f"{taken} MiB"
