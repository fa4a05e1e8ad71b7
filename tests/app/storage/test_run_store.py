from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from palpate.app.http_errors import Missing
from palpate.app.storage.run_store import RunStore
from palpate.foundation.errors import RunError


def test_only_whole_runs_are_listed(place: Any, run_name: str) -> None:
    (place.runs / ".making" / "half").mkdir(parents=True)
    (place.runs / "empty").mkdir()
    assert [run.name for run in RunStore(place.runs).all()] == [run_name]


@pytest.mark.parametrize("name", ["..", "../runs", ".making", "a/b", "", "nowhere"])
def test_names_that_are_no_run_are_refused(place: Any, name: str) -> None:
    with pytest.raises(Missing, match="there is no run"):
        RunStore(place.runs).get(name)


def test_truncated_replay_is_told_with_its_file(place: Any, run_name: str) -> None:
    file = place.runs / run_name / "replays" / "poke-01.npz"
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(RunError, match=r"replays/poke-01\.npz cannot be read"):
        RunStore(place.runs).get(run_name).replay("poke-01")


def test_replay_without_an_array_names_it(place: Any, run_name: str) -> None:
    np.savez(place.runs / run_name / "replays" / "poke-01.npz", time=np.zeros(3))
    with pytest.raises(RunError, match="lacks cloud_index, faces"):
        RunStore(place.runs).get(run_name).replay("poke-01")


def test_report_that_is_no_json_is_told(place: Any, run_name: str) -> None:
    (place.runs / run_name / "report.json").write_text("{")
    with pytest.raises(RunError, match=r"report\.json cannot be read"):
        _ = RunStore(place.runs).get(run_name).report


@pytest.mark.parametrize("name", ["../report.json", "nothing.png", ".."])
def test_pictures_do_not_lead_out_of_their_folder(place: Any, run_name: str, name: str) -> None:
    with pytest.raises(Missing, match="no picture"):
        RunStore(place.runs).get(run_name).picture(name)
