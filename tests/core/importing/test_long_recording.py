"""A bag as the paper's bench records it becomes the sequences that were pushed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from large_tool import large_tool_dataset
from long_recording import LongRecording

from palpate.dataset import Dataset, open_dataset
from palpate.dataset.sequence import Sequence
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import import_recordings
from palpate.importing.mapping_file import mapping_text, read_mapping
from palpate.importing.survey import survey


@pytest.mark.more
def test_one_long_bag_of_another_clock_becomes_a_sound_dataset(tmp_path: Path) -> None:
    source = open_dataset(large_tool_dataset(tmp_path / "source"))
    begins = LongRecording(source).write(tmp_path / "bench.bag")
    stated = (source.path / "dataset.toml").read_text().partition("[splits]")[0]
    (tmp_path / "dataset.toml").write_text(stated)
    found = survey([tmp_path / "bench.bag"], tmp_path / "dataset.toml")
    mapping = found.proposal("bench", ImportNotes())
    found.close()
    (tmp_path / "import.toml").write_text(mapping_text(mapping))
    notes = ImportNotes()
    made = tmp_path / "made"
    import_recordings(read_mapping(tmp_path / "import.toml"), tmp_path, made, notes)
    assert any("its clock is 1699995000.0" in one for one in notes.warnings)
    assert any("dwells lie as the landmarks do" in one for one in notes.decisions)
    dataset = open_dataset(made)
    kinds = {name.rsplit("-", 1)[0] for name in dataset.sequences}
    assert kinds == {"poke-top", "poke-side"} and len(dataset.sequences) == 9
    compared = sum(
        _same_views(source, begins, dataset.sequence(name)) for name in dataset.sequences
    )
    assert compared > 100
    apart = dataset.touches.positions - source.touches.positions
    assert np.abs(apart).max() < 1e-3


def _same_views(source: Dataset, begins: dict[str, float], sequence: Sequence) -> int:
    """Compare the clouds of an imported sequence with those that were played at the same times.

    The camera's clock is known by the least delays of delivery only, here to some milliseconds.
    """
    start = sequence.kinematics.time[0]
    played = max((one for one in begins if begins[one] <= start), key=lambda one: begins[one])
    original = source.sequence(played)
    times = original.cloud_times + begins[played] - original.kinematics.time[0]
    compared = 0
    for at, time in enumerate(sequence.cloud_times):
        near = int(np.abs(times - time).argmin())
        if abs(times[near] - time) < 0.03:
            one, other = sequence.cloud(at), original.cloud(near)
            np.testing.assert_array_equal(_sorted(one), _sorted(other))
            compared += 1
    return compared


def _sorted(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(points.T)]
