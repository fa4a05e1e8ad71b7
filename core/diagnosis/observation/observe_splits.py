"""Observations of the sequences that a diagnosis is fitted on, and of those of the test."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from palpate.dataset import Dataset
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.force_only import observe_each
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.experiment import Experiment
from palpate.foundation.errors import DiagnosisError
from palpate.foundation.progress import Report, part
from palpate.setup.setup import Sensor

__all__ = ["SplitObservations", "check_splits", "observe_splits"]

SplitObservations = tuple[list[Observations], list[Observations]]
"""Observations of the fitted sequences and of the test sequences."""


def check_splits(dataset: Dataset) -> None:
    """Raise DiagnosisError where the splits of a dataset cannot carry a diagnosis."""
    config = dataset.config
    fitted = (*config.train, *config.validation)
    if len(fitted) < 2:
        raise DiagnosisError(
            f"[splits] train and validation name {len(fitted)} sequences, at least 2 are needed: "
            "causes are fitted on some and judged on others",
            key="splits",
        )
    clouds = any(len(dataset.sequence(name)) for name in (*fitted, *config.test))
    if clouds and not any(len(dataset.sequence(name)) for name in fitted):
        raise DiagnosisError(
            "[splits] only the test sequences have clouds; fit on some that have, or leave them "
            "out",
            key="splits",
        )
    if clouds and config.test and not any(len(dataset.sequence(name)) for name in config.test):
        raise DiagnosisError(
            "[splits] no test sequence has clouds, though some that are fitted have; name one in "
            "test",
            key="splits",
        )


def observe_splits(
    experiment: Experiment,
    sensor: Sensor,
    begin: Callable[..., Future[Observations]],
    report: Report,
) -> SplitObservations:
    """Observe the fitted and the test sequences, their frames by the clock of this sensor.

    Args:
        experiment: the registered dataset with its splits.
        sensor: whose clock groups the frames.
        begin: runs a task in another process.
        report: progress.
    """
    config, setup = experiment.dataset.config, experiment.observation_setup(sensor)
    limits = CRITERIA.grouping
    return (
        observe_each(
            experiment,
            (*config.train, *config.validation),
            setup,
            (limits.fitted_groups, limits.fitted_force_groups),
            part(report, 0.0, 0.7),
            begin,
        ),
        observe_each(
            experiment,
            tuple(config.test),
            setup,
            (limits.test_groups, limits.test_force_groups),
            part(report, 0.7, 1.0),
            begin,
        ),
    )
