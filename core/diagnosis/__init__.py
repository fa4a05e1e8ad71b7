"""Diagnosis: what the simulation gets wrong, the cause by name, the extended model and the gain.

The steps are observation (clouds and forces in groups of frames), forward (predictions and their
derivatives), inference (noise, evidence, fits), search (candidates and selection), gain and
validation on held-out sequences, design of the next push, and report.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from palpate.diagnosis.result import DiagnosisResult, diagnose

__all__ = ["DiagnosisResult", "diagnose"]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used: the pipeline is heavy to import."""
    if name in __all__:
        return getattr(import_module("palpate.diagnosis.result"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
