"""A registration of the camera that a person accepted, to be used in place of the automatic one."""

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
    """Camera to phantom as it was accepted under a name.

    Attributes:
        name: under which it is kept.
        phantom_from_camera: the pose.
        covariance: (6, 6) [m, rad] of a small motion about `pivot` (3,) [m], phantom frame (see
            palpate.registration.pose).
        weak_directions: of the pose, in words.
        pairs: how many pairs of points a person clicked; 0 for one found automatically.
        residual: RMS distance [m] of the rest cloud's points to block or table; None where it was
            not said.
        rest: digest of the rest cloud's file that it was made from; empty where it was not said.
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
        """From what `to_json` gives, or a file of accepted registrations; RegistrationError where
        that is not whole.
        """
        found = stored.get("registration", stored)
        try:
            return cls(
                name=str(stored["name"]),
                phantom_from_camera=Transform.from_matrix(
                    np.array(found["phantom_from_camera"], dtype=float)
                ),
                covariance=_array(found["covariance"], (6, 6)),
                pivot=_array(found["pivot"], (3,)),
                weak_directions=tuple(map(str, found.get("weak_directions", ()))),
                pairs=int(stored["pairs"]) if "pairs" in stored else len(stored.get("points", ())),
                residual=found.get("residual_after", found.get("residual")),
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
        """Plain values, from which `from_json` makes it again: what reports and models keep of
        where they come from.
        """
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
        """RegistrationError where the rest cloud is not the one that it was made from."""
        if self.rest and (found := rest_digest(folder)) != self.rest:
            raise RegistrationError(
                f"registration {self.name} was made from another rest.ply (digest {self.rest}) "
                f"than the one in {folder.name} "
                f"({found}): register this dataset anew",
                file="rest.ply",
                value=found,
            )


def rest_digest(folder: Path) -> str:
    """A digest of the rest cloud's file, by which it is known again; empty where there is none."""
    file = folder / "rest.ply"
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16] if file.is_file() else ""


def _array(values: Any, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(values, dtype=float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(
            f"an array of shape {array.shape}, expected finite numbers of shape {shape}"
        )
    return array
