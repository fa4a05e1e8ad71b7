"""The datasets that the page may name: folders directly below one folder, nothing outside it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from palpate.app.http_errors import Missing
from palpate.app.scene.manual_registration import Phantom
from palpate.app.storage.run_store import NAME
from palpate.foundation.errors import DatasetError, RegistrationError

if TYPE_CHECKING:
    from palpate.dataset import Dataset

__all__ = ["Library"]


class Library:
    """Names and opens the datasets below `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """The folders that hold a dataset.toml, sorted."""
        return sorted(
            path.parent.name
            for path in self.folder.glob("*/dataset.toml")
            if NAME.fullmatch(path.parent.name)
        )

    def path(self, name: str) -> Path:
        """The folder of one dataset; a name that leads elsewhere is refused."""
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
                f"there is no dataset {name}; GET /api/datasets lists those there are", dataset=name
            )
        return path

    def phantom(self, name: str) -> Phantom:
        """Rest cloud and block of one dataset, to be registered by hand."""
        from palpate.setup.setup import Shape

        dataset = self.open(name)
        if isinstance(dataset.geometry, Shape):
            raise RegistrationError(
                "clouds are registered to a block only, not to other shapes yet"
            )
        if not dataset.has_rest:
            raise RegistrationError(
                "the dataset has no rest.ply: record one cloud of the untouched phantom",
                file="rest.ply",
            )
        config = dataset.config
        return Phantom(dataset.rest_cloud(), config.size, dict(config.landmarks), config.to_phantom)

    def open(self, name: str) -> Dataset:
        """One dataset, validated as far as opening does."""
        from palpate.dataset import open_dataset

        return open_dataset(self.path(name))
