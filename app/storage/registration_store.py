"""Accepted registrations by name, below the runs folder; none is overwritten."""

from __future__ import annotations

import json
import os
import time
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from palpate.app.http_errors import Conflict, Missing
from palpate.app.storage.result_store import NAME, ResultStore, read_object
from palpate.dataset.accepted_registration import AcceptedRegistration, rest_digest
from palpate.foundation.errors import RegistrationError, RunError
from palpate.foundation.processes import ProcessPool

if TYPE_CHECKING:
    from palpate.dataset import Dataset

__all__ = ["RegistrationStore", "accepted_for", "refuse_unregistrable", "register"]


class RegistrationStore(ResultStore):
    """The registrations of one dataset, in `runs`/registrations/DATASET/NAME.json."""

    def __init__(self, runs: Path, dataset: str) -> None:
        self.dataset = _checked(dataset)
        super().__init__(runs / "registrations" / dataset, "registration", "", "")

    def names(self) -> list[str]:
        """Names of the registrations, sorted."""
        files = self.folder.glob("*.json")
        return sorted(path.stem for path in files if NAME.fullmatch(path.stem))

    def has_begun(self, name: str) -> bool:
        """Whether there is a registration of this name."""
        return self._path(name).is_file()

    def missing(self, name: str) -> Missing:
        """The error for a name that no registration has."""
        return Missing(
            f"{self.dataset} has no registration {name}", dataset=self.dataset, registration=name
        )

    def accepted(self, name: str) -> AcceptedRegistration:
        """One registration, for use in place of the automatic one."""
        return AcceptedRegistration.from_json(self.request(name))

    def check_name(self, name: str) -> None:
        """Raise RegistrationError for an invalid name, Conflict for one that is taken."""
        if self._path(name).exists():
            raise self._taken(name)

    def save(self, name: str, registration: dict[str, Any]) -> dict[str, Any]:
        """Store a registration under a new name; raises Conflict where the name is taken."""
        path = self._path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        head = {"format": 1, "name": name, "dataset": self.dataset, "created": time.time()}
        stored = {**head, **registration}
        whole = path.with_name(f".{uuid4().hex}")
        whole.write_text(json.dumps(stored, indent=1))
        try:
            # Unlike a rename, a link fails where the name is taken, even by a request at the same
            # moment.
            os.link(whole, path)
        except FileExistsError as error:
            raise self._taken(name) from error
        finally:
            whole.unlink()
        return stored

    def _taken(self, name: str) -> Conflict:
        return Conflict(
            f"{self.dataset} has a registration {name} already: choose another name",
            registration=name,
        )

    def _object(self, name: str, file: str) -> dict[str, Any]:
        return read_object(self._path(name), self.kind, name)

    def _path(self, name: str) -> Path:
        return self.folder / f"{_checked(name, longest=64)}.json"


def _checked(name: str, longest: int = 255) -> str:
    if not NAME.fullmatch(name) or len(name) > longest:
        raise RegistrationError(
            f"{name!r} is no name: at most 64 letters, digits, dot, dash, underscore", key="name"
        )
    return name


def accepted_for(dataset: Path, named: str | None, runs: Path) -> AcceptedRegistration | None:
    """The registration that the command line names: a file, or a name stored below `runs`."""
    if named is None:
        return None
    if not Path(named).is_file():
        return RegistrationStore(runs, dataset.resolve().name).accepted(named)
    try:
        return AcceptedRegistration.from_json(json.loads(Path(named).read_text()))
    except (OSError, ValueError) as error:
        raise RegistrationError(
            f"{named} cannot be read ({error}); name a registration that was accepted", file=named
        ) from error


def refuse_unregistrable(dataset: Dataset) -> None:
    """Raise RegistrationError for a dataset whose cloud cannot be registered to its phantom."""
    if not dataset.has_rest:
        raise RegistrationError(
            "the dataset has no rest.ply: record one cloud of the untouched phantom",
            file="rest.ply",
        )


def register(dataset: Path, cloud: list[list[float]], mesh: list[list[float]]) -> dict[str, Any]:
    """Fit pairs of points and refine by ICP, in another process: the server loads no Open3D.

    Args:
        dataset: the dataset's folder.
        cloud: points on the rest cloud [m], camera frame.
        mesh: the same points on the phantom [m], phantom frame.
    """
    with ProcessPool(1) as pool:
        try:
            return pool.submit(_register, dataset, cloud, mesh).result()
        except BrokenProcessPool:
            raise RunError(
                "the process that registers ended, most likely for want of memory; try again"
            ) from None


def _register(dataset: Path, cloud: list[list[float]], mesh: list[list[float]]) -> dict[str, Any]:
    from palpate.dataset import open_dataset
    from palpate.registration.point_pairs import register_pairs

    opened = open_dataset(dataset)
    refuse_unregistrable(opened)
    config = opened.config
    registration = register_pairs(
        opened.rest_cloud(), opened.geometry, np.array(cloud), np.array(mesh), config.depth_sigma
    )
    points = [{"cloud": one, "mesh": other} for one, other in zip(cloud, mesh, strict=True)]
    return {"points": points, "registration": registration.to_json(), "rest": rest_digest(dataset)}
