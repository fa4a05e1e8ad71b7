"""Whatever bytes stand in a dataset, the reader either takes it or raises its own error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.foundation.errors import DatasetError

FILES = (
    "dataset.toml",
    "touches.csv",
    "rest.ply",
    "sequences/poke-01/kinematics.csv",
    "sequences/poke-01/clouds.csv",
    "sequences/poke-01/forces.csv",
    "sequences/poke-01/clouds/000000.ply",
)
SNIPPETS = (
    b"\0",
    b"\n",
    b"\r",
    b",",
    b"[",
    b"]",
    b'"',
    b"nan",
    b"-inf",
    b"1e999",
    b"../",
    b"\xff\xfe",
    b"end_header\n",
    b"9" * 30,
    b"_",
    b"=",
)

Edit = tuple[float, int, bytes]
edits = st.lists(
    st.tuples(
        st.floats(0, 1),
        st.integers(0, 40),
        st.one_of(st.binary(max_size=12), st.sampled_from(SNIPPETS)),
    ),
    min_size=1,
    max_size=4,
)


def edited(data: bytes, changes: list[Edit]) -> bytes:
    for place, removed, inserted in changes:
        at = int(place * len(data))
        data = data[:at] + inserted + data[at + removed :]
    return data


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_valid_dataset(tmp_path_factory.mktemp("fuzz") / "block")


def read_with(folder: Path, file: str, change: Callable[[bytes], bytes]) -> DatasetError | None:
    """Error of the reader while one file of the folder is changed; other exceptions propagate."""
    path = folder / file
    whole = path.read_bytes()
    path.write_bytes(change(whole))
    try:
        open_dataset(folder).validate()
    except DatasetError as error:
        return error
    finally:
        path.write_bytes(whole)
    return None


def names_its_file(error: DatasetError) -> bool:
    return bool(error.where["file"]) and error.where["file"] in error.message


@pytest.mark.parametrize("file", FILES)
@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@example(changes=[(0.0, 10**6, b"")])
@given(changes=edits)
def test_changed_bytes_raise_nothing_but_a_dataset_error(
    folder: Path, file: str, changes: list[Edit]
) -> None:
    error = read_with(folder, file, lambda data: edited(data, changes))
    assert error is None or names_its_file(error)


@pytest.mark.parametrize("file", FILES)
@settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(content=st.binary(max_size=200))
def test_any_bytes_in_the_place_of_a_file_raise_nothing_but_a_dataset_error(
    folder: Path, file: str, content: bytes
) -> None:
    error = read_with(folder, file, lambda data: content)
    assert error is None or names_its_file(error)
