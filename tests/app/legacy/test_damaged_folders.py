"""Old result folders that are damaged, or not Palpate's at all, never make a listing fail."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from old_results import OldHome, unpack_old_results

from palpate.app.settings import Settings

LISTINGS = ("runs", "sweeps", "trainings", "evaluations", "jobs", "diagnoses", "datasets", "disk")
KINDS = ("sweeps", "trainings", "evaluations")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> OldHome:
    return unpack_old_results(tmp_path_factory.mktemp("whole"))


def cut(path: Path) -> None:
    """Leave the first half of a file, as a full disk does."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def empty(path: Path) -> None:
    path.write_bytes(b"")


def other(path: Path) -> None:
    """JSON, but not an object."""
    path.write_text("[1, 2]")


def binary(path: Path) -> None:
    path.write_bytes(b"\xff\xfe\x00\x80" * 9)


def folder(path: Path) -> None:
    """A folder where a file belongs."""
    path.unlink()
    path.mkdir()


HARMS: dict[str, Callable[[Path], None]] = {
    "missing": Path.unlink,
    "cut": cut,
    "empty": empty,
    "other": other,
    "binary": binary,
    "folder": folder,
}
FILES = (
    *(f"{{run}}/{name}" for name in ("report.json", "model.json", "origin.json", "patterns.npz")),
    "{run}/replays/{sequence}.npz",
    "corrections/{run}/{sequence}.npz",
    *(f"sweeps/{{sweeps}}/{name}" for name in ("request.json", "summary.json", "points.jsonl")),
    *(f"trainings/{{trainings}}/{name}" for name in ("request.json", "training.json")),
    *(f"trainings/{{trainings}}/{name}" for name in ("history.json", "network.pt")),
    "evaluations/{evaluations}/evaluation.json",
    "registrations/large-tool/by-hand.json",
)


@pytest.mark.parametrize("harm", HARMS)
def test_damaged_files_are_named_and_everything_else_is_there(
    whole: OldHome, tmp_path: Path, serve: Any, harm: str
) -> None:
    home = OldHome(tmp_path / "home", whole.expected)
    shutil.copytree(whole.path, home.path, copy_function=shutil.copy2)
    names = {kind: list_names(home, kind)[0] for kind in KINDS}
    names |= {"run": home.run(), "sequence": "poke-top-03"}
    for file in FILES:
        path = home.runs / file.format(**names)
        if path.is_file():
            HARMS[harm](path)
    (home.runs / "jobs.sqlite").unlink()  # the jobs that wait are not what is looked at
    settings = Settings(runs=home.runs, datasets=home.datasets, preload=())
    with serve(settings) as client:
        for listing in LISTINGS:
            answer = client.get(f"/api/{listing}")
            assert answer.status_code == 200, f"{listing}: {answer.text}"
        runs = {run["id"] for run in client.get("/api/runs").json()}
        assert len(runs) >= 1
        for kind in KINDS:
            listed = {one["id"] for one in client.get(f"/api/{kind}").json()}
            assert set(list_names(whole, kind)) - {names[kind]} <= listed
        paths = [f"runs/{names['run']}{more}" for more in ("", "/report", "/model", "/patterns")]
        paths += [f"runs/{names['run']}/sequences/{names['sequence']}"]
        paths += [f"runs/{names['run']}/{more}" for more in ("report.html", "comparison")]
        paths += [f"{kind}/{names[kind]}" for kind in KINDS]
        paths += [f"sweeps/{names['sweeps']}/points"]
        paths += ["datasets/large-tool/registrations", "datasets/large-tool/registrations/by-hand"]
        for asked in paths:
            answer = client.get(f"/api/{asked}")
            assert answer.status_code < 500, f"{asked}: {answer.text}"
            if answer.status_code >= 400:
                assert set(answer.json()) == {"kind", "message", "where"}
        evaluation = client.post("/api/evaluations", json={"dataset": "large-tool"})
        assert evaluation.status_code in (202, 404, 422), evaluation.text


def list_names(home: OldHome, kind: str) -> list[str]:
    """Names of the folders of a kind."""
    return sorted(
        path.name for path in (home.runs / kind).iterdir() if not path.name.startswith(".")
    )


def test_folders_of_other_programs_are_passed_over(
    whole: OldHome, tmp_path: Path, serve: Any
) -> None:
    home = OldHome(tmp_path / "home", whole.expected)
    shutil.copytree(whole.path, home.path, copy_function=shutil.copy2)
    (home.runs / "jobs.sqlite").unlink()
    for parent in (home.runs, *(home.runs / kind for kind in KINDS), home.datasets):
        strange = parent / "of-another-program"
        (strange / "replays").mkdir(parents=True)
        for name in ("report.json", "request.json", "evaluation.json", "training.json"):
            (strange / name).write_text(json.dumps({"title": "ours", "values": [1, {"a": None}]}))
        (parent / "notes.txt").write_text("not a result")
        (parent / "with blanks and ü").mkdir()
    (home.runs / home.run() / "extra.bin").write_bytes(bytes(range(256)))
    (home.runs / home.run() / "replays" / "notes.txt").write_text("not a replay")
    (home.runs / "uploads" / "strange").mkdir(parents=True)
    settings = Settings(runs=home.runs, datasets=home.datasets, preload=())
    with serve(settings) as client:
        for listing in LISTINGS:
            answer = client.get(f"/api/{listing}")
            assert answer.status_code == 200, f"{listing}: {answer.text}"
            for one in answer.json() if isinstance(answer.json(), list) else ():
                found = client.get(f"/api/{listing}/{one['id']}")
                assert found.status_code < 500, found.text
        run = client.get(f"/api/runs/{home.run()}").json()
        assert [one["name"] for one in run["sequences"]] == [
            one["name"] for one in home.answers[f"runs/{home.run()}"]["answer"]["sequences"]
        ]
