"""The REST service from Python: request jobs, follow them, and fetch their results.

::

    with Client("http://127.0.0.1:8321") as palpate:
        job = palpate.sweep("block-01", {"poisson_ratio.nu": (0.3, 0.49)}, steps=7)
        palpate.wait(job["id"], print)
        print(palpate.sweep_result(job["id"])["summary"]["best"])
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from uuid import uuid4

import httpx

from palpate.foundation.errors import PalpateError

__all__ = ["ApiError", "Client", "JobError"]

PATIENCE = 120.0
"""Longest time of one answer [s]; a registration is computed while the client waits."""

PAUSE = 0.3


class ApiError(PalpateError):
    """The service refused a request; `status` is the HTTP status, `kind` the class of the error."""

    def __init__(self, status: int, kind: str, message: str, where: Mapping[str, Any]) -> None:
        super().__init__(
            message, **{key: value for key, value in where.items() if key != "message"}
        )
        self.status, self.kind = status, kind


class JobError(PalpateError):
    """A job ended without its result; `job` is its last record."""

    def __init__(self, job: dict[str, Any]) -> None:
        message = (job["error"] or {}).get("message", job["text"])
        super().__init__(f"{job['kind']} {job['id']} is {job['state']}: {message}", job=job["id"])
        self.job = job


class Client:
    """Client of one server.

    All methods raise ApiError for refused requests, and httpx.TransportError where nothing answers.

    Args:
        address: of the server.
        token: printed by `palpate serve`, if it needs a login.
        timeout: of one answer [s].
    """

    def __init__(self, address: str, token: str | None = None, timeout: float = PATIENCE) -> None:
        headers = {"authorization": f"Bearer {token}"} if token else {}
        self._http = httpx.Client(
            base_url=f"{address.rstrip('/')}/api", headers=headers, timeout=timeout
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def datasets(self) -> list[str]:
        """Names of the datasets that the server has."""
        return list(self._get("/datasets")["datasets"])

    def check(self, dataset: str) -> dict[str, Any]:
        """Read every file of a dataset and describe it."""
        return dict(self._get(f"/datasets/{dataset}/check"))

    def import_archive(self, file: Path, name: str, key: str | None = None) -> dict[str, Any]:
        """Queue the import of a dataset's folder packed as .zip or .tar, under this name."""
        headers = {
            "idempotency-key": key or uuid4().hex,
            "content-type": "application/octet-stream",
        }
        with Path(file).open("rb") as content:
            return dict(
                self._answer(
                    self._http.post(
                        "/imports", params={"name": name}, content=content, headers=headers
                    )
                )
            )

    def import_folder(self, folder: str, name: str, key: str | None = None) -> dict[str, Any]:
        """Queue the import of a folder on the server's own disk."""
        return self._ask("/imports/folder", {"folder": folder, "name": name}, key)

    def upload(self, file: Path) -> str:
        """Send one file of a recording; the token stands for it in a look."""
        headers = {"content-type": "application/octet-stream"}
        with Path(file).open("rb") as content:
            answer = self._http.post(
                "/uploads", params={"file": Path(file).name}, content=content, headers=headers
            )
        return str(self._answer(answer)["file"])

    def look(
        self, files: Sequence[str] = (), key: str | None = None, **further: Any
    ) -> dict[str, Any]:
        """Queue a look at files (tokens of uploads, or paths on the server's disk), or at
        `dataset`; `further` as in POST /api/looks. The id of the job will be the look's.
        """
        return self._ask("/looks", {"files": list(files), **further}, key)

    def look_result(self, identity: str) -> dict[str, Any]:
        """A finished look."""
        return dict(self._get(f"/looks/{identity}"))

    def import_look(
        self, look: str, name: str, key: str | None = None, **edited: Any
    ) -> dict[str, Any]:
        """Queue the import of a look's recordings as a dataset; `edited` is its mapping or its
        sequences, as in POST /api/looks/{id}/import.
        """
        return self._ask(f"/looks/{look}/import", {"name": name, **edited}, key)

    def registrations(self, dataset: str) -> list[str]:
        """Names of the accepted registrations of a dataset."""
        return list(self._get(f"/datasets/{dataset}/registrations")["registrations"])

    def registration(self, dataset: str, name: str) -> dict[str, Any]:
        """One accepted registration."""
        return dict(self._get(f"/datasets/{dataset}/registrations/{name}"))

    def register(
        self, dataset: str, accept: str | None = None, key: str | None = None
    ) -> dict[str, Any]:
        """Queue the automatic registration of a dataset, and store it under a name."""
        return self._ask(f"/datasets/{dataset}/registrations/automatic", {"accept": accept}, key)

    def register_pairs(
        self, dataset: str, pairs: Sequence[Mapping[str, Any]], accept: str | None = None
    ) -> dict[str, Any]:
        """Register by pairs of points `{"cloud": [x, y, z], "mesh": [x, y, z]}` [m], then ICP; the
        result is stored if a name is given.
        """
        body = {"pairs": [dict(pair) for pair in pairs], "accept": accept}
        return dict(self._answer(self._http.post(f"/datasets/{dataset}/registrations", json=body)))

    def replay(
        self,
        dataset: str,
        sequences: Sequence[str] = (),
        effects: Sequence[Mapping[str, Any]] = (),
        key: str | None = None,
        registration: str | None = None,
    ) -> dict[str, Any]:
        """Queue a replay of sequences (all if empty) with these effects; the id of the job will be
        its run's.
        """
        body = {
            "dataset": dataset,
            "sequences": list(sequences),
            "effects": list(effects),
            "registration": registration,
        }
        return self._ask("/replays", body, key)

    def export(
        self, run: str, what: Sequence[str] = ("report", "model"), key: str | None = None
    ) -> dict[str, Any]:
        """Queue the export of parts of a run as files."""
        return self._ask("/exports", {"run": run, "what": list(what)}, key)

    def download(self, export: str, file: str) -> bytes:
        """One file of a finished export."""
        answer = self._http.get(f"/exports/{export}/{file}")
        return answer.content if answer.is_success else bytes(self._answer(answer))

    def effects(self) -> list[dict[str, Any]]:
        """The catalogue of effects with parameters, units and bounds (SI)."""
        return list(self._get("/effects"))

    def diagnose(
        self, dataset: str, seed: int = 0, key: str | None = None, registration: str | None = None
    ) -> dict[str, Any]:
        """Queue a diagnosis, with an accepted registration if named; the id of the job will be its
        run's.
        """
        return self._ask(
            "/diagnoses", {"dataset": dataset, "seed": seed, "registration": registration}, key
        )

    def sweep(
        self,
        dataset: str,
        parameters: Mapping[str, tuple[float, float]],
        key: str | None = None,
        **further: Any,
    ) -> dict[str, Any]:
        """Queue a sweep of `effect.parameter` between two values each (SI).

        Args:
            dataset: name of the dataset.
            parameters: range of each parameter.
            key: repeated requests with the same key make one job.
            further: as in POST /api/sweeps.
        """
        axes = [
            {"parameter": name, "low": low, "high": high}
            for name, (low, high) in parameters.items()
        ]
        return self._ask("/sweeps", {"dataset": dataset, "parameters": axes, **further}, key)

    def sweep_result(self, identity: str) -> dict[str, Any]:
        """A sweep: the request, and its summary once it has ended."""
        return dict(self._get(f"/sweeps/{identity}"))

    def points(self, identity: str) -> list[dict[str, Any]]:
        """The finished points of a sweep, in the order of their ends."""
        points: list[dict[str, Any]] = []
        while more := self._get(f"/sweeps/{identity}/points", after=len(points))["points"]:
            points += more
        return points

    def train(
        self, dataset: str, run: str | None = None, key: str | None = None, **further: Any
    ) -> dict[str, Any]:
        """Queue a training on the raw model, or on a run's extended one; `further` as in POST
        /api/trainings.
        """
        return self._ask("/trainings", {"dataset": dataset, "run": run, **further}, key)

    def training(self, identity: str) -> dict[str, Any]:
        """A training: the request, its history by epoch, and its summary once it has ended."""
        return dict(self._get(f"/trainings/{identity}"))

    def evaluate(
        self, dataset: str, run: str | None = None, key: str | None = None, **further: Any
    ) -> dict[str, Any]:
        """Queue an evaluation of the test sequences; `further` as in POST /api/evaluations."""
        return self._ask("/evaluations", {"dataset": dataset, "run": run, **further}, key)

    def evaluation(self, identity: str) -> dict[str, Any]:
        """An evaluation: its summary once it has ended."""
        return dict(self._get(f"/evaluations/{identity}"))

    def report(self, run: str) -> dict[str, Any]:
        """The report of a finished diagnosis."""
        return dict(self._get(f"/runs/{run}/report"))

    def jobs(self) -> Iterator[dict[str, Any]]:
        """All jobs, the newest first."""
        after = 0
        while page := self._get("/jobs", after=after):
            yield from page
            after += len(page)

    def job(self, identity: str) -> dict[str, Any]:
        """One job as it is now."""
        return dict(self._get(f"/jobs/{identity}"))

    def wait(
        self, identity: str, report: Callable[[float, str], object] = lambda *_: None
    ) -> dict[str, Any]:
        """Wait until a job is done, calling `report(fraction, text)`; raises JobError where it ends
        otherwise.
        """
        while (job := self.job(identity))["state"] in ("queued", "running"):
            report(job["fraction"], job["text"])
            time.sleep(PAUSE)
        if job["state"] != "done":
            raise JobError(job)
        report(1.0, job["text"])
        return job

    def cancel(self, identity: str) -> dict[str, Any]:
        """Stop a job."""
        return dict(self._answer(self._http.post(f"/jobs/{identity}/cancel")))

    def retry(self, identity: str) -> dict[str, Any]:
        """Repeat a job that ended without its result."""
        return dict(self._answer(self._http.post(f"/jobs/{identity}/retry")))

    def _get(self, path: str, **query: Any) -> Any:
        """Ask; a second time where the connection broke, as one does that was idle for too long."""
        try:
            answer = self._http.get(path, params=query)
        except httpx.TransportError:
            answer = self._http.get(path, params=query)
        return self._answer(answer)

    def _ask(self, path: str, body: dict[str, Any], key: str | None) -> dict[str, Any]:
        """Request a job; repeat once where the connection broke, which the key makes harmless."""
        headers = {"idempotency-key": key or uuid4().hex}
        try:
            answer = self._http.post(path, json=body, headers=headers)
        except httpx.TransportError:
            answer = self._http.post(path, json=body, headers=headers)
        return dict(self._answer(answer))

    def _answer(self, answer: httpx.Response) -> Any:
        if answer.is_success:
            return answer.json()
        try:
            body = answer.json()
            raise ApiError(answer.status_code, body["kind"], body["message"], body["where"])
        except (ValueError, KeyError, TypeError):
            raise ApiError(
                answer.status_code, "HttpError", f"{answer.url} answered {answer.status_code}", {}
            ) from None
