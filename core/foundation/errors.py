"""The errors of the package, as one tree.

PalpateError: a problem a user can act on. The message says what was found, what was expected, and
what to do.

- DatasetError: a file of a dataset is missing or wrong; names file, row and key.
- RegistrationError: frames could not be related to one another, or only doubtfully.
- SetupError: an assumption about the experiment is impossible; names key, value and bounds.
- MeshError: a surface, shape or grid cannot be filled with elements; names file, numbers and place.
- SolveError: a frame has no equilibrium; names frame, residual and cause.
- EffectError: an unknown effect, or a parameter out of bounds; names parameter, value and bounds.
- DiagnosisError: the data cannot carry a diagnosis.
- CorrectionError: samples, networks and trainings do not fit together; names key and value.
- RunError: a result on disk is missing or incomplete.

Cancelled is no error: the user stopped a long command.
"""

from __future__ import annotations

from typing import Any

__all__ = [
    "Cancelled",
    "CorrectionError",
    "DatasetError",
    "DiagnosisError",
    "EffectError",
    "MeshError",
    "PalpateError",
    "RegistrationError",
    "RunError",
    "SetupError",
    "SolveError",
]


class PalpateError(Exception):
    """A problem a user can act on.

    Attributes:
        message: one sentence for the user.
        where: the place of the problem as plain values (file, row, key, frame ...).
    """

    def __init__(self, message: str, **where: Any) -> None:
        super().__init__(message)
        self.message = message
        self.where = {key: value for key, value in where.items() if value is not None}


class DatasetError(PalpateError):
    """A file of a dataset is missing or wrong; `where` has file, row and key as far as they
    apply.
    """


class RegistrationError(PalpateError):
    """Frames could not be related to one another."""


class SetupError(PalpateError):
    """An impossible assumption about the experiment; `where` has key, value, low and high."""


class MeshError(PalpateError):
    """A surface, shape or grid that cannot be filled with elements.

    `where` has the file and what was counted.
    """


class SolveError(PalpateError):
    """No equilibrium was found; `where` has outcome, frame and residual."""


class EffectError(PalpateError):
    """An unknown effect or a parameter out of bounds.

    `where` has parameter, value, low and high.
    """


class DiagnosisError(PalpateError):
    """Data that cannot carry a diagnosis; the message says what is missing."""


class CorrectionError(PalpateError):
    """Samples, networks or a training that do not fit together; `where` has key and value."""


class RunError(PalpateError):
    """A result on disk that is missing or incomplete."""


class Cancelled(Exception):
    """Raised by `report(...)` when the user stopped a long command."""
