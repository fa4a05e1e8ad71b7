"""Accepted registrations of the camera, which replace the automatic one."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform

__all__ = ["AcceptedRegistration", "rest_digest"]


@dataclass(frozen=True, eq=False)
class AcceptedRegistration:
    """A registration of the camera to the phantom that a person accepted.

    Attributes:
        name: of the registration.
        phantom_from_camera: the pose.
        covariance: (6, 6) [m, rad] of a small motion about `pivot` (see palpate.registration.pose).
        pivot: (3,) [m], phantom frame.
        weak_directions: sentences about poorly determined directions of the pose.
        pairs: number of pairs of points that a person clicked; 0 for an automatic one.
        residual: RMS distance of the rest cloud's points to block or table [m]; None if unknown.
        rest: digest of the rest cloud's file; empty if unknown.
    """

    name: str
    phantom_from_camera: Transform
    covariance: FloatArray
    pivot: FloatArray
    weak_directions: tuple[str, ...] = ()
    pairs: int = 0
    residual: float | None = None
    rest: str = ""

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> AcceptedRegistration:
        """Read the output of `to_json`, or a file of accepted registrations; RegistrationError
        where it is incomplete.
        """
        values = stored.get("registration", stored)
        try:
            return cls(
                name=str(stored["name"]),
                phantom_from_camera=Transform.from_matrix(
                    np.array(values["phantom_from_camera"], dtype=float)
                ),
                covariance=_array(values["covariance"], (6, 6)),
                pivot=_array(values["pivot"], (3,)),
                weak_directions=tuple(map(str, values.get("weak_directions", ()))),
                pairs=int(stored["pairs"]) if "pairs" in stored else len(stored.get("points", ())),
                residual=values.get("residual_after", values.get("residual")),
                rest=str(stored.get("rest", "")),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise RegistrationError(
                f"this is no accepted registration ({type(error).__name__}: {error}); make one in "
                "the page's panel Register, or by "
                "POST /api/datasets/NAME/registrations",
                key=str(error) if isinstance(error, KeyError) else None,
            ) from error

    def to_json(self) -> dict[str, Any]:
        """Plain values for reports and models, readable by `from_json`."""
        return {
            "name": self.name,
            "by": "hand" if self.pairs else "automatic",
            "pairs": self.pairs,
            "residual": self.residual,
            "phantom_from_camera": self.phantom_from_camera.matrix.tolist(),
            "covariance": self.covariance.tolist(),
            "pivot": self.pivot.tolist(),
            "weak_directions": list(self.weak_directions),
            "rest": self.rest,
        }

    def check(self, folder: Path) -> None:
        """Raise RegistrationError where the dataset has another rest cloud."""
        if self.rest and (digest := rest_digest(folder)) != self.rest:
            raise RegistrationError(
                f"registration {self.name} was made from another rest.ply (digest {self.rest}) "
                f"than the one in {folder.name} "
                f"({digest}): register this dataset anew",
                file="rest.ply",
                value=digest,
            )


def rest_digest(folder: Path) -> str:
    """Digest of the rest cloud's file; empty without one."""
    file = folder / "rest.ply"
    if not file.is_file():
        return ""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def _array(values: Any, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(values, dtype=float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(
            f"an array of shape {array.shape}, expected finite numbers of shape {shape}"
        )
    return array
