"""Camera to phantom from an accepted registration in place of a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.dataset.accepted_registration import AcceptedRegistration
from palpate.registration.camera.camera_fit import CameraFit

__all__ = ["accepted_camera_fit"]

APART = 3.0e-3
"""Distance between the accepted pose and the fit from there beyond which a warning is given [m]."""


def accepted_camera_fit(fit: CameraFit, accepted: AcceptedRegistration) -> CameraFit:
    """The accepted pose and its covariance, with statistics of the rest cloud.

    Args:
        fit: of the rest cloud from the accepted pose on.
        accepted: the registration.
    """
    motion = fit.phantom_from_camera @ accepted.phantom_from_camera.inverse()
    apart = float(np.linalg.norm(motion.apply(fit.pivot) - fit.pivot))
    warnings = list(fit.warnings)
    if apart > APART:
        warnings.append(
            f"The accepted registration {accepted.name} lies {apart * 1e3:.1f} mm from where the "
            "rest cloud would draw it "
            f"(under {APART * 1e3:.0f} mm is expected): look at it again."
        )
    return replace(
        fit,
        phantom_from_camera=accepted.phantom_from_camera,
        covariance=accepted.covariance,
        weak_directions=accepted.weak_directions,
        warnings=tuple(warnings),
    )
