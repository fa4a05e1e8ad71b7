"""All nuisances, and random choices of them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from palpate.foundation.errors import RunError
from palpate.synthetic.nuisances.camera_timing import LostFrames, RollingShutter, WarmUp
from palpate.synthetic.nuisances.cameras import CAMERAS
from palpate.synthetic.nuisances.depth_noise import FlyingPixels, MultiPath, SmoothBias, StereoNoise
from palpate.synthetic.nuisances.driver_filters import (
    Decimation,
    HoleFilling,
    SpatialFilter,
    TemporalFilter,
)
from palpate.synthetic.nuisances.lost_pixels import DarkHoles, Gloss, MaskedTool
from palpate.synthetic.nuisances.nuisance import Nuisance
from palpate.synthetic.nuisances.phantom_form import Draft, RoundedEdges, SaggingTop, Texture
from palpate.synthetic.nuisances.robot_errors import (
    Backlash,
    CableStretch,
    CalibrationError,
    EncoderSteps,
    RobotRate,
)
from palpate.synthetic.nuisances.tool_form import Neck, OtherShaft, OutOfRound

__all__ = ["FAULTS", "FILTERS", "NUISANCES", "draw_nuisances"]

NUISANCES: tuple[type[Nuisance], ...] = (
    RoundedEdges,
    Draft,
    SaggingTop,
    OtherShaft,
    Neck,
    OutOfRound,
    CalibrationError,
    Backlash,
    CableStretch,
    EncoderSteps,
    RobotRate,
    LostFrames,
    Texture,
    RollingShutter,
    MultiPath,
    SmoothBias,
    WarmUp,
    FlyingPixels,
    StereoNoise,
    Gloss,
    DarkHoles,
    MaskedTool,
    Decimation,
    SpatialFilter,
    HoleFilling,
    TemporalFilter,
)
"""In the order in which they act."""

FILTERS: dict[str, type[Nuisance]] = {
    "decimation": Decimation,
    "spatial": SpatialFilter,
    "hole-filling": HoleFilling,
    "temporal": TemporalFilter,
}
FAULTS: dict[str, type[Nuisance]] = {kind.__name__: kind for kind in NUISANCES if kind.causes}
"""Nuisances that effects state, by name."""
_ALWAYS = (SmoothBias, FlyingPixels, StereoNoise)
_RARE = (MaskedTool, MultiPath)
_OFTEN, _SELDOM, _FILTERED = 0.5, 0.2, 0.5
"""Probabilities [1] of a nuisance, of a rare one, and of a filter."""


def draw_nuisances(
    seed: int,
    *,
    noisy: bool = False,
    camera: str | None = None,
    filters: Sequence[str] | None = None,
    faults: Sequence[str] = (),
) -> tuple[Nuisance, ...]:
    """Draw nuisances from a random stream of their own; of FAULTS only those asked for.

    Args:
        seed: of the stream.
        noisy: whether the depth noise is 1 to 3 mm, not 0.3 to 1 mm.
        camera: one of CAMERAS, in place of drawn noise and flying pixels.
        filters: some of FILTERS, in place of a drawn one.
        faults: some of FAULTS.

    Raises:
        RunError: for an unknown camera, filter or fault.
    """
    rng = np.random.default_rng([seed, 5501])
    drawn: dict[type[Nuisance], Nuisance] = {}
    for kind in NUISANCES:
        chance = 1.0 if kind in _ALWAYS else _SELDOM if kind in _RARE else _OFTEN
        # Drawn whether it is used or not, so that one option leaves the others' draws alone.
        used, one = rng.random() < chance, kind.draw(rng)
        if used and not kind.causes and kind not in FILTERS.values():
            drawn[kind] = one
    if noisy:
        drawn[StereoNoise] = StereoNoise.between(rng, 1e-3, 3e-3)
    if camera is not None:
        for kind in (FlyingPixels, MultiPath, StereoNoise):
            drawn.pop(kind, None)
        _require(camera, CAMERAS, "camera")
        drawn |= {type(one): one for one in CAMERAS[camera]}
    if filters is None:
        free = [name for name, kind in FILTERS.items() if not kind.causes]
        filters = [str(rng.choice(free))] if rng.random() < _FILTERED else []
    for name in filters:
        _require(name, FILTERS, "filter")
        drawn[FILTERS[name]] = FILTERS[name].draw(rng)
    for name in faults:
        _require(name, FAULTS, "fault")
        drawn[FAULTS[name]] = FAULTS[name].draw(rng)
    return tuple(drawn[kind] for kind in NUISANCES if kind in drawn)


def _require(name: str, known: Collection[str], what: str) -> None:
    if name not in known:
        raise RunError(
            f"the virtual bench has no {what} {name!r}; it has {', '.join(known)}", **{what: name}
        )
