"""Palpate: replay palpation of soft tissue in FEM, see what it gets wrong, and name the cause.

    import palpate as pp
    experiment = pp.register(pp.open_dataset("my-block"))
    replay = experiment.replay("poke-top-01")
    print(pp.compare(replay).rms, replay.force)  # m, N
    result = pp.diagnose(experiment.dataset, out="runs/one")
    print(result.verdict, result.causes)

Lengths are metres, forces newtons, times seconds, angles radians. Names are loaded when first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if __name__ != "palpate":
    raise ImportError(
        f"{__name__} is a folder of Palpate's sources, not a package: write 'import palpate', and "
        f"'palpate.fem' in place of '{__name__}.fem'",
        name=__name__,
    )

if TYPE_CHECKING:
    from palpate import effects
    from palpate.dataset import Dataset
    from palpate.diagnosis import DiagnosisResult, diagnose
    from palpate.experiment import Experiment, ReplayedSequence, register
    from palpate.foundation.errors import PalpateError
    from palpate.importing.opened_bags import open_dataset
    from palpate.recording.compare_replay import ReplayComparison, compare
    from palpate.setup.setup import Setup

__all__ = [
    "Dataset",
    "DiagnosisResult",
    "Experiment",
    "PalpateError",
    "ReplayComparison",
    "ReplayedSequence",
    "Setup",
    "compare",
    "diagnose",
    "effects",
    "open_dataset",
    "register",
]

_PLACES = {
    "Dataset": "palpate.dataset",
    "DiagnosisResult": "palpate.diagnosis",
    "Experiment": "palpate.experiment",
    "PalpateError": "palpate.foundation.errors",
    "ReplayComparison": "palpate.recording.compare_replay",
    "ReplayedSequence": "palpate.experiment",
    "Setup": "palpate.setup.setup",
    "compare": "palpate.recording.compare_replay",
    "diagnose": "palpate.diagnosis",
    "open_dataset": "palpate.importing.opened_bags",
    "register": "palpate.experiment",
}
"""Module of each public name."""


def __getattr__(name: str) -> Any:
    """Load a public name from its module."""
    if name in _PLACES:
        return getattr(import_module(_PLACES[name]), name)
    if name == "effects":
        return import_module("palpate.effects")
    raise AttributeError(f"module 'palpate' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
