"""The datasets that requests may name: folders directly below one folder, nothing outside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.app.http_errors import Missing
from palpate.app.storage.result_store import NAME
from palpate.foundation.errors import DatasetError

if TYPE_CHECKING:
    from palpate.dataset import Dataset

__all__ = ["Library"]


class Library:
    """Names and opens the datasets below `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """Names of the folders that contain a dataset.toml, sorted."""
        return sorted(
            path.parent.name
            for path in self.folder.glob("*/dataset.toml")
            if NAME.fullmatch(path.parent.name)
        )

    def path(self, name: str) -> Path:
        """The folder of one dataset.

        Raises:
            DatasetError: the name is invalid or leads out of the datasets folder.
            Missing: no dataset has this name.
        """
        if not NAME.fullmatch(name):
            raise DatasetError(
                f"{name!r} is no name of a dataset folder: letters, digits, dot, dash, underscore",
                key="dataset",
            )
        path = (self.folder / name).resolve()
        if path.parent != self.folder.resolve():
            raise DatasetError(
                f"{name} leads out of the datasets folder; copy the data into it", key="dataset"
            )
        if not path.is_dir():
            raise Missing(
                f"there is no dataset {name}; GET /api/datasets lists the existing ones",
                dataset=name,
            )
        return path

    def open(self, name: str) -> Dataset:
        """Open one dataset, with the checks of `open_dataset`."""
        from palpate.dataset import open_dataset

        return open_dataset(self.path(name))

    def data_changed(self, name: str, made: Mapping[str, Any]) -> bool | None:
        """Whether a dataset's files differ from those that a result was made from, by its
        `made_from`; None where that is not known.
        """
        from palpate.dataset.provenance import data_changed

        return data_changed(self.folder / name, made) if NAME.fullmatch(name) else None
