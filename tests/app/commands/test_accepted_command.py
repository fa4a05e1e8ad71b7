"""Verbs of the terminal that take an accepted registration: by its name below the runs folder, or
by its file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from small_dataset import write_valid_dataset
from typer.testing import CliRunner

from palpate.app.cli import app
from palpate.app.jobs.short_tasks import register
from palpate.app.storage.registration_store import RegistrationStore, accepted_for
from palpate.foundation.errors import RegistrationError
from palpate.foundation.progress import silent


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset, and its automatic registration kept under a name."""
    folder = tmp_path_factory.mktemp("accepted")
    write_valid_dataset(folder / "small")
    asked = {
        "dataset": str(folder / "small"),
        "name": "small",
        "runs": str(folder / "runs"),
        "accept": "mine",
    }
    assert register(asked, silent)["registration"] == "mine"
    return folder


def test_a_registration_is_found_by_name_and_by_file_and_none_is_the_automatic_one(
    home: Path,
) -> None:
    by_name = accepted_for(home / "small", "mine", home / "runs")
    by_file = accepted_for(
        home / "small",
        str(home / "runs" / "registrations" / "small" / "mine.json"),
        home / "elsewhere",
    )
    assert by_name is not None and by_file is not None and by_name.to_json() == by_file.to_json()
    assert accepted_for(home / "small", None, home / "runs") is None
    (home / "broken.json").write_text("{}")
    with pytest.raises(RegistrationError, match="no accepted registration"):
        accepted_for(home / "small", str(home / "broken.json"), home / "runs")


def test_a_replay_in_the_terminal_uses_it_and_refuses_an_unknown_one(
    home: Path, tmp_path: Path
) -> None:
    asked = [
        "replay",
        str(home / "small"),
        "--sequence",
        "poke-01",
        "--grid",
        "5x3x3",
        "--runs",
        str(home / "runs"),
    ]
    done = CliRunner().invoke(
        app, [*asked, "--out", str(tmp_path / "a.npz"), "--registration", "mine"]
    )
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    assert (tmp_path / "a.npz").is_file()
    refused = CliRunner().invoke(
        app, [*asked, "--out", str(tmp_path / "b.npz"), "--registration", "none"]
    )
    assert (
        "small has no registration none" in str(refused.exception)
        and not (tmp_path / "b.npz").exists()
    )


def test_a_diagnosis_in_the_terminal_is_given_it(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: dict[str, Any] = {}

    def noted(*_: Any, **asked: Any) -> dict[str, Any]:
        given.update(asked)
        return {"verdict": "none", "causes": []}

    monkeypatch.setattr(
        "palpate.app.jobs.tasks.diagnose_into", noted
    )  # what it does with it is tested where it is done
    CliRunner().invoke(
        app,
        ["diagnose", str(home / "small"), "--registration", "mine", "--runs", str(home / "runs")],
    )
    assert (
        given["accepted"].to_json()
        == RegistrationStore(home / "runs", "small").accepted("mine").to_json()
    )
