"""Tables of any dialect give the same poses, forces and clouds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.table_source import TableSource
from palpate.importing.stream import Source

TIMES = 1_700_000_000_123_456_789 + np.arange(40) * 10_000_000
ANGLES = np.linspace(0, 1, 40)
POSES = np.stack(
    [
        0.1 + 0.02 * ANGLES, -0.05 + 0.01 * ANGLES, 0.2 - 0.03 * ANGLES,
        0 * ANGLES, 0 * ANGLES, np.sin(ANGLES / 2), np.cos(ANGLES / 2),
    ],
    axis=-1,
)  # fmt: skip
HEADER = "t,x,y,z,qx,qy,qz,qw"


def rows(unit: float = 1.0, times: list[str] | None = None) -> list[list[str]]:
    stamps = times or [f"{t // 10**9}.{t % 10**9:09d}" for t in TIMES.tolist()]
    scaled = np.concatenate([POSES[:, :3] * unit, POSES[:, 3:]], axis=1)
    return [[stamp, *(f"{v:.9f}" for v in row)] for stamp, row in zip(stamps, scaled, strict=True)]


def text(header: str | None, body: list[list[str]], separator: str = ",", end: str = "\n") -> str:
    lines = [separator.join(row) for row in body]
    return end.join(([] if header is None else [header]) + lines) + end


def poses(source: Source) -> tuple[np.ndarray, np.ndarray]:
    stream = next(one for one in source.streams() if one.kind == "pose")
    samples = list(source.samples({stream.name}))
    return np.array([one.stamped for one in samples]), np.array([one.value() for one in samples])


def assert_poses(path: Path, content: str | bytes, rules: ColumnRules | None = None) -> TableSource:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    source = TableSource(path, rules)
    times, values = poses(source)
    np.testing.assert_array_equal(times, TIMES)
    np.testing.assert_allclose(values, POSES, atol=2e-9)
    return source


def german(row: list[str]) -> list[str]:
    return [cell.replace(".", ",") for cell in row]


DIALECTS: dict[str, str | bytes] = {
    "plain": text(HEADER, rows()),
    "windows": text(HEADER, rows(), end="\r\n"),
    "byte order mark": b"\xef\xbb\xbf" + text(HEADER, rows()).encode(),
    "utf-16": text(HEADER, rows()).encode("utf-16"),
    "tabs": text(HEADER.replace(",", "\t"), rows(), "\t"),
    "blanks": text(HEADER.replace(",", " "), rows(), " "),
    "semicolons": text(HEADER.replace(",", ";"), rows(), ";"),
    "decimal commas": text(HEADER.replace(",", ";"), [german(row) for row in rows()], ";"),
    "quotes": text(
        ",".join(f'"{name}"' for name in HEADER.split(",")),
        [[f'"{cell}"' for cell in row] for row in rows()],
    ),
    "comments": "# bench 3\n% of Tuesday\n" + text(HEADER, rows()) + "# end\n",
    "cut off in its last row": text(HEADER, rows()) + "1700000001.0,0.1",
    "millimetres": text(HEADER.replace("x,y,z,", "x (mm),y (mm),z (mm),"), rows(1000)),
    "millimetres unsaid": text(HEADER, rows(1000)),
    "nanoseconds": text(HEADER, rows(times=[str(t) for t in TIMES.tolist()])),
    "microseconds": text(
        "time_us," + HEADER[2:], rows(times=[f"{t // 1000}.{t % 1000:03d}" for t in TIMES.tolist()])
    ),
    "other names": text("timestamp,px,py,pz,quat_x,quat_y,quat_z,quat_w", rows()),
    "real part first": text(
        "t,x,y,z,qw,qx,qy,qz", [[*row[:4], row[7], *row[4:7]] for row in rows()]
    ),
    "numbered quaternion": text(
        "t,x,y,z,q0,q1,q2,q3", [[*row[:4], row[7], *row[4:7]] for row in rows()]
    ),
    "ros2 topic echo --csv": text(
        None,
        [
            [str(t // 10**9), str(t % 10**9), "PSM1_base", *row[1:]]
            for t, row in zip(TIMES.tolist(), rows(), strict=True)
        ],
    ),
}


@pytest.mark.parametrize("dialect", list(DIALECTS))
def test_poses_are_the_same_in_every_dialect(tmp_path: Path, dialect: str) -> None:
    assert_poses(tmp_path / "poses.csv", DIALECTS[dialect])


def test_rostopic_echo_keeps_stamp_and_receipt_apart(tmp_path: Path) -> None:
    header = (
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,"
        "field.pose.position.y,field.pose.position.z,field.pose.orientation.x,"
        "field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w"
    )
    body = [
        [str(t + 3_000_000), str(at), str(t), "ECM", *row[1:]]
        for at, (t, row) in enumerate(zip(TIMES.tolist(), rows(), strict=True))
    ]
    source = assert_poses(tmp_path / "pose.csv", text(header, body))
    assert source.has_receipt
    first = next(source.samples({"pose.csv#pose"}))
    assert first.received - first.stamped == 3_000_000


def test_units_that_were_told_by_size_are_said(tmp_path: Path) -> None:
    source = assert_poses(tmp_path / "poses.csv", DIALECTS["millimetres unsaid"])
    assert "taken as mm" in source.warnings[0]
    assert source.rules is not None and source.rules.length_unit == "mm"


def test_milliseconds_from_zero_are_told_by_the_rate(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text(text(HEADER, rows(times=[str(10 * at) for at in range(40)])))
    source = TableSource(path)
    times, _ = poses(source)
    np.testing.assert_array_equal(times, np.arange(40) * 10**7)
    assert "100 Hz" in source.warnings[0]


def test_unknown_names_are_listed_and_a_mapping_reads_them(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text(text("a,b,c,d,e,f,g,h", rows(1000)))
    source = TableSource(path)
    assert [(one.kind, one.message_type) for one in source.streams()] == [
        ("other", "table of a, b, c, d, e, f, g, h")
    ]
    columns = dict(zip(HEADER.split(","), "abcdefgh", strict=True))
    assert_poses(path, path.read_bytes(), ColumnRules(columns=columns, length_unit="mm"))


def test_a_word_among_numbers_is_named_with_its_row(tmp_path: Path) -> None:
    body = rows()
    body[20][2] = "open"
    path = tmp_path / "poses.csv"
    path.write_text("# bench 3\n\n" + text(HEADER, body))
    with pytest.raises(DatasetError, match=r"row 24: y = 'open'"):
        TableSource(path)


def test_one_table_may_hold_poses_and_forces(tmp_path: Path) -> None:
    path = tmp_path / "all.csv"
    body = [[*row, "0.5", "0", str(at)] for at, row in enumerate(rows())]
    path.write_text(text(f"{HEADER},fx (mN),fy (mN),fz (mN)", body))
    source = TableSource(path)
    assert [one.kind for one in source.streams()] == ["pose", "wrench"]
    last = list(source.samples({"all.csv#wrench"}))[-1]
    np.testing.assert_allclose(last.value()[:3], [5e-4, 0, 0.039])


def test_matlab_matrices_become_columns(tmp_path: Path) -> None:
    path = tmp_path / "bench.mat"
    seconds = np.arange(40) * 0.01
    savemat(path, {"t": seconds, "p": POSES[:, :3], "f": 0.1 * POSES[:, :3], "note": "x"})
    source = TableSource(path)
    times, values = poses(source)
    np.testing.assert_allclose(times / 1e9, seconds, atol=1e-9)
    np.testing.assert_allclose(values[:, :3], POSES[:, :3])
    wrench = [one.value() for one in source.samples({"bench.mat#wrench"})]
    np.testing.assert_allclose(np.array(wrench)[:, :3], 0.1 * POSES[:, :3])


def test_matlab_objects_are_refused_by_their_names(tmp_path: Path) -> None:
    path = tmp_path / "bench.mat"
    savemat(path, {"probe": {"force": 1.0}})
    with pytest.raises(DatasetError, match="holds probe, no matrix"):
        TableSource(path)
