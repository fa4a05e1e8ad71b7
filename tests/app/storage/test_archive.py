"""Archives of strangers: whole or not at all, and nothing outside the folder."""

from __future__ import annotations

import io
import stat
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate.app.storage.archive import copy_folder, dataset_root, unpack
from palpate.app.storage.archive_reader import is_archive
from palpate.foundation.errors import DatasetError

MOST = 10_000


def zipped(path: Path, **entries: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name.replace("__", "/"), content)
    return path


def taped(
    path: Path, name: str, kind: bytes = tarfile.REGTYPE, content: bytes = b"x", link: str = ""
) -> Path:
    with tarfile.open(path, "w:gz") as archive:
        info = tarfile.TarInfo(name)
        info.type, info.size, info.linkname = (
            kind,
            len(content) if kind == tarfile.REGTYPE else 0,
            link,
        )
        archive.addfile(info, io.BytesIO(content))
    return path


def nothing_outside(folder: Path) -> bool:
    return sorted(path.name for path in folder.iterdir() if path.suffix not in (".zip", ".gz")) in (
        [],
        ["into"],
    )


@pytest.mark.parametrize("pack", ["zip", "tar"])
def test_plain_files_come_out_as_they_went_in(tmp_path: Path, pack: str) -> None:
    archive = (
        zipped(tmp_path / "a.zip", a__b=b"hello")
        if pack == "zip"
        else taped(tmp_path / "a.tar.gz", "./a/b", content=b"hello")
    )
    assert is_archive(archive)
    unpack(archive, tmp_path / "into", MOST)
    assert (tmp_path / "into" / "a" / "b").read_bytes() == b"hello"


@pytest.mark.parametrize(
    "name",
    [
        "../evil",
        "/evil",
        "a/../../evil",
        "a\\..\\evil",
        "C:evil",
        "a\x1fb",
        "/".join("abcdefghi"),
        "x" * 300,
    ],
)
def test_names_that_lead_elsewhere_are_refused_by_name(tmp_path: Path, name: str) -> None:
    archive = tmp_path / "a.zip"
    with zipfile.ZipFile(archive, "w") as opened:
        opened.writestr("good", b"x")
        opened.writestr(zipfile.ZipInfo(name), b"x")
    with pytest.raises(DatasetError, match="1 entries may not be"):
        unpack(archive, tmp_path / "into", MOST)
    with pytest.raises(DatasetError):
        unpack(taped(tmp_path / "a.tar.gz", name), tmp_path / "into", MOST)
    assert (
        nothing_outside(tmp_path)
        and not (tmp_path.parent / "evil").exists()
        and not (tmp_path / "into").exists()
    )


@pytest.mark.parametrize(
    "kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.FIFOTYPE, tarfile.CHRTYPE]
)
def test_links_and_devices_are_refused(tmp_path: Path, kind: bytes) -> None:
    with pytest.raises(DatasetError, match="link or no plain file"):
        unpack(
            taped(tmp_path / "a.tar.gz", "rest.ply", kind, link="/etc/passwd"),
            tmp_path / "into",
            MOST,
        )
    info = zipfile.ZipInfo("rest.ply")
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr(info, "/etc/passwd")
    with pytest.raises(DatasetError, match="link or no plain file"):
        unpack(tmp_path / "a.zip", tmp_path / "into", MOST)
    assert nothing_outside(tmp_path)


def test_bombs_are_refused_whether_they_say_their_size_or_not(tmp_path: Path) -> None:
    bomb = zipped(tmp_path / "a.zip", big=b"0" * (20 * MOST))
    assert bomb.stat().st_size < MOST
    with pytest.raises(DatasetError, match="at most"):
        unpack(bomb, tmp_path / "into", MOST)
    data = bytearray(bomb.read_bytes())
    for at in (
        data.find(b"PK\x03\x04") + 22,
        data.find(b"PK\x01\x02") + 24,
    ):  # the size that both headers state
        data[at : at + 4] = (100).to_bytes(4, "little")
    bomb.write_bytes(bytes(data))
    with pytest.raises(DatasetError):
        unpack(bomb, tmp_path / "into", MOST)
    assert (
        sum(path.stat().st_size for path in (tmp_path / "into").rglob("*") if path.is_file())
        <= 2**20
    )


def test_what_is_twice_there_encrypted_or_broken_is_refused(tmp_path: Path) -> None:
    with (
        zipfile.ZipFile(tmp_path / "a.zip", "w") as archive,
        pytest.warns(UserWarning, match="Duplicate"),
    ):
        archive.writestr("a", b"1")
        archive.writestr("a", b"2")
    with pytest.raises(DatasetError, match="is there twice"):
        unpack(tmp_path / "a.zip", tmp_path / "into", MOST)
    data = bytearray(zipped(tmp_path / "b.zip", a=b"1").read_bytes())
    data[data.find(b"PK\x01\x02") + 8] |= 1
    (tmp_path / "b.zip").write_bytes(bytes(data))
    with pytest.raises(DatasetError, match="is encrypted"):
        unpack(tmp_path / "b.zip", tmp_path / "into", MOST)
    (tmp_path / "c.zip").write_bytes(b"neither")
    with pytest.raises(DatasetError, match="neither a zip nor a tar"):
        unpack(tmp_path / "c.zip", tmp_path / "into", MOST)
    cut = zipped(tmp_path / "d.zip", a=b"hello" * 100)
    raw = bytearray(cut.read_bytes())
    raw[40:60] = b"\xff" * 20
    cut.write_bytes(bytes(raw))
    with pytest.raises(DatasetError, match="cannot be read"):
        unpack(cut, tmp_path / "into", MOST)


def test_a_folder_is_copied_without_its_links(tmp_path: Path) -> None:
    (tmp_path / "from" / "sequences").mkdir(parents=True)
    (tmp_path / "from" / "sequences" / "a").write_text("x")
    copy_folder(tmp_path / "from", tmp_path / "into", MOST)
    assert (tmp_path / "into" / "sequences" / "a").read_text() == "x"
    (tmp_path / "from" / "passwd").symlink_to("/etc/passwd")
    with pytest.raises(DatasetError, match="passwd: is a link"):
        copy_folder(tmp_path / "from", tmp_path / "again", MOST)


def test_the_dataset_is_found_at_the_top_or_one_folder_down_and_only_one(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"no dataset\.toml"):
        dataset_root(tmp_path)
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "dataset.toml").touch()
    assert dataset_root(tmp_path) == tmp_path / "a"
    (tmp_path / "dataset.toml").touch()
    with pytest.raises(DatasetError, match="2 datasets"):
        dataset_root(tmp_path)


def test_progress_is_told(tmp_path: Path) -> None:
    told: list[Any] = []
    unpack(
        zipped(tmp_path / "a.zip", a=b"1", b=b"2"),
        tmp_path / "into",
        MOST,
        lambda *said: told.append(said),
    )
    assert told and "file 1 of 2" in told[0][1]


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_DEFLATED])
def test_damaged_archives_of_every_method_are_told_as_damaged(tmp_path: Path, method: int) -> None:
    path, rng = tmp_path / "a.zip", np.random.default_rng(0)
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("a", bytes(rng.integers(0, 64, 5000, dtype=np.uint8)))
    whole, told = path.read_bytes(), 0
    for number in range(200):
        data = bytearray(whole)
        data[int(rng.integers(30, len(data)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(data))
        try:
            unpack(path, tmp_path / f"into-{number}", MOST)
        except DatasetError:
            told += 1
    assert told > 100
