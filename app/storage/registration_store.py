"""Registrations made by hand, by name: one file each below the runs folder, never in the dataset,
never over an older one.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from palpate.app.http_errors import Conflict, Missing
from palpate.app.storage.run_store import NAME
from palpate.dataset.accepted_registration import Accepted, rest_digest
from palpate.foundation.errors import RegistrationError, RunError
from palpate.foundation.processes import ProcessPool

__all__ = ["Registrations", "accepted_for", "register"]

FOLDER = "registrations"


class Registrations:
    """The registrations of all datasets, in `runs`/registrations/DATASET/NAME.json."""

    def __init__(self, runs: Path) -> None:
        self._folder = runs / FOLDER

    def names(self, dataset: str) -> list[str]:
        """The registrations of one dataset, sorted."""
        return sorted(
            path.stem
            for path in (self._folder / dataset).glob("*.json")
            if NAME.fullmatch(path.stem)
        )

    def get(self, dataset: str, name: str) -> dict[str, Any]:
        """One registration, or Missing."""
        path = self._path(dataset, name)
        if not path.is_file():
            raise Missing(
                f"{dataset} has no registration {name}", dataset=dataset, registration=name
            )
        try:
            stored: dict[str, Any] = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise RunError(
                f"registration {name} of {dataset} cannot be read ({error}); make it again",
                file=path.name,
            ) from error
        return stored

    def accepted(self, dataset: str, name: str) -> Accepted:
        """One registration, to be used in place of the automatic one."""
        return Accepted.from_json(self.get(dataset, name))

    def check_name(self, dataset: str, name: str) -> None:
        """Refuse what is no name, and one that is taken."""
        if self._path(dataset, name).exists():
            raise Conflict(
                f"{dataset} has a registration {name} already: choose another name",
                registration=name,
            )

    def save(self, dataset: str, name: str, found: dict[str, Any]) -> dict[str, Any]:
        """Keep a registration under a new name; Conflict where the name is taken."""
        path = self._path(dataset, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        stored = {"format": 1, "name": name, "dataset": dataset, "created": time.time(), **found}
        whole = path.with_name(f".{uuid4().hex}")
        whole.write_text(json.dumps(stored, indent=1))
        try:
            # A link, unlike a renaming, fails where the name is taken, even by a request at the
            # same moment.
            os.link(whole, path)
        except FileExistsError as error:
            raise Conflict(
                f"{dataset} has a registration {name} already: choose another name",
                registration=name,
            ) from error
        finally:
            whole.unlink()
        return stored

    def _path(self, dataset: str, name: str) -> Path:
        if not (NAME.fullmatch(dataset) and NAME.fullmatch(name)) or len(name) > 64:
            raise RegistrationError(
                f"{name!r} is no name: at most 64 letters, digits, dot, dash, underscore",
                key="name",
            )
        return self._folder / dataset / f"{name}.json"


def accepted_for(dataset: Path, said: str | None, runs: Path) -> Accepted | None:
    """What the terminal calls a registration: a file of one, or the name of one that is kept below
    `runs` for this dataset.
    """
    if said is None:
        return None
    if not Path(said).is_file():
        return Registrations(runs).accepted(dataset.resolve().name, said)
    try:
        return Accepted.from_json(json.loads(Path(said).read_text()))
    except (OSError, ValueError) as error:
        raise RegistrationError(
            f"{said} cannot be read ({error}); name a registration that was accepted", file=said
        ) from error


def register(dataset: Path, cloud: list[list[float]], mesh: list[list[float]]) -> dict[str, Any]:
    """Fit pairs and run ICP from there in a process of its own, since the server itself loads no
    Open3D.
    """
    with ProcessPool(1) as pool:
        return pool.submit(_register, dataset, cloud, mesh).result()


def _register(dataset: Path, cloud: list[list[float]], mesh: list[list[float]]) -> dict[str, Any]:
    from palpate.dataset import open_dataset
    from palpate.registration.point_pairs import register_pairs
    from palpate.setup.setup import Shape

    opened = open_dataset(dataset)
    if isinstance(opened.geometry, Shape):
        raise RegistrationError("clouds are registered to a block only, not to other shapes yet")
    if not opened.has_rest:
        raise RegistrationError(
            "the dataset has no rest.ply: record one cloud of the untouched phantom",
            file="rest.ply",
        )
    config = opened.config
    found = register_pairs(
        opened.rest_cloud(), config.size, np.array(cloud), np.array(mesh), config.depth_sigma
    )
    points = [{"cloud": one, "mesh": other} for one, other in zip(cloud, mesh, strict=True)]
    return {"points": points, "registration": found.to_json(), "rest": rest_digest(dataset)}
