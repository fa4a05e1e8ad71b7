"""A diagnosis for a script: run it, read its verdict, plot its patterns."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from palpate.dataset import Dataset, open_dataset
from palpate.diagnosis.pipeline import diagnose as write_run
from palpate.diagnosis.report.error_patterns import ErrorPatterns, patterns_figure
from palpate.foundation.errors import RunError
from palpate.foundation.figure import save_figure
from palpate.foundation.progress import Report, silent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DiagnosisResult", "diagnose"]


@dataclass(frozen=True, eq=False)
class DiagnosisResult:
    """A run folder of a diagnosis.

    Attributes:
        folder: the run folder.
        report: `report.json`, as docs/pages/report-format.md describes it.
        model: `model.json`, the extended model.
    """

    folder: Path
    report: Mapping[str, Any]
    model: Mapping[str, Any]

    @classmethod
    def load(cls, folder: Path | str) -> Self:
        """Open a run folder; raises RunError where a file is missing or cannot be read."""
        place = Path(folder)
        try:
            report, model = (
                json.loads((place / name).read_text()) for name in ("report.json", "model.json")
            )
        except (OSError, ValueError) as error:
            raise RunError(f"{place} is no whole run folder ({error})", file=str(place)) from error
        return cls(place, report, model)

    @property
    def verdict(self) -> str:
        """One of found, none, ambiguous and unexplained."""
        return str(self.report["verdict"])

    @property
    def causes(self) -> list[dict[str, Any]]:
        """The named causes: effect, probability, and parameters with value, unit and interval."""
        return list(self.report["causes"])

    @property
    def gain(self) -> Mapping[str, Any] | None:
        """Errors on the test sequences, without and with the causes; None without such."""
        return self.report.get("gain")

    @property
    def stiffness_map(self) -> Mapping[str, Any] | None:
        """The free map of the stiffness; None where the causes leave nothing open."""
        return self.report.get("stiffness_map")

    def plot_patterns(self, file: Path | str | None = None) -> Figure:
        """Draw the measured error pattern beside the pattern that the named causes predict.

        Args:
            file: PNG to write; none where it is not given.

        Raises RunError for a diagnosis from forces alone, which has no surface patterns.
        """
        patterns = self.folder / "patterns.npz"
        if not patterns.is_file():
            raise RunError(
                f"{self.folder} has no patterns.npz: this diagnosis compared forces alone",
                file=str(patterns),
            )
        figure = patterns_figure(ErrorPatterns.load(patterns))
        if file is not None:
            save_figure(figure, Path(file))
        return figure


def diagnose(
    dataset: Dataset | Path | str,
    out: Path | str,
    *,
    workers: int = 2,
    seed: int = 0,
    report: Report = silent,
) -> DiagnosisResult:
    """Find the causes of the stated simulation's error in a dataset.

    Args:
        dataset: as opened, or the path of its folder.
        out: run folder to make.
        workers: number of processes. A script that uses more than the main process must guard its
            calls by `if __name__ == "__main__":`, as for every use of processes.
        seed: of the null draws and the bootstrap.
        report: progress.

    Raises DiagnosisError where the data cannot carry a diagnosis, DatasetError and
    RegistrationError where they are wrong, RunError where `out` exists.
    """
    opened = dataset if isinstance(dataset, Dataset) else open_dataset(Path(dataset))
    write_run(opened, Path(out), workers=workers, seed=seed, report=report)
    return DiagnosisResult.load(out)
