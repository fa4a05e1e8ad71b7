"""Tables that are made to fill the memory: each is refused, and takes little of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset.csv_table import read_numbers
from palpate.foundation.errors import DatasetError

MEASURED = """
import pathlib, resource, sys
from palpate.dataset.csv_table import read_numbers
from palpate.foundation.errors import DatasetError
idle = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    read_numbers(pathlib.Path(sys.argv[1]), "table.csv", "t,x")
except DatasetError as error:
    print(error)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - idle) / 1024)
"""


@pytest.mark.parametrize(
    ("begin", "block", "count", "told"),
    [
        (b"t,x\n", b"\n" * 2**20, 300, "table.csv, row 2: more than 1000000 empty rows follow"),
        (b"t,x\n1,", b"1," * 2**19, 300, "table.csv, row 2: is longer than 64 KiB"),
        (b"", b" " * 2**20, 300, "table.csv, row 1: is longer than 64 KiB"),
    ],
    ids=["line-ends", "one-row", "spaces"],
)
def test_bomb_is_refused_with_little_memory(
    tmp_path: Path, begin: bytes, block: bytes, count: int, told: str
) -> None:
    with (tmp_path / "table.csv").open("wb") as sink:
        sink.write(begin)
        for _ in range(count):
            sink.write(block)
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, str(tmp_path)], capture_output=True, text=True, check=True
    )
    message, taken = done.stdout.strip().rsplit("\n", 1)
    assert told in message
    assert float(taken) < 150, f"{taken} MiB"


def test_rows_are_numbered_across_blocks(tmp_path: Path) -> None:
    rows = [f"{number},{2 * number}.5" for number in range(200_000)]
    table = tmp_path / "table.csv"
    table.write_text("\r\n".join(["t,x", *rows, "", "  ", ""]))
    numbers = read_numbers(tmp_path, "table.csv", "t,x")
    assert np.array_equal(numbers[:, 0], np.arange(200_000))
    rows[150_000] = "1;2"
    table.write_text("\n".join(["t,x", *rows]))
    with pytest.raises(DatasetError, match=r"table.csv, row 150002: 1 columns; expected 2"):
        read_numbers(tmp_path, "table.csv", "t,x")
    rows[150_000] = ""
    table.write_text("\n".join(["t,x", *rows]))
    with pytest.raises(DatasetError, match=r"table.csv, row 150002: an empty line"):
        read_numbers(tmp_path, "table.csv", "t,x")
