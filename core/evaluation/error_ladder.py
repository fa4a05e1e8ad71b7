"""The ladder: models with and without a network on the same pushes, for all of them, each sequence,
and each kind of motion.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.gain.probe_errors import ProbeSums, paper_sums, probe_sums, removed_share
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import DiagnosisError
from palpate.setup.setup import Setup

__all__ = ["Rung", "build_ladder"]

_DIGITS = 4
_ORDER = ("all", "seen", "unseen", "kind", "sequence")


@dataclass(frozen=True, eq=False, kw_only=True)
class Rung:
    """One model of the ladder.

    Attributes:
        name: "baseline", "baseline_network", "extended", "extended_network", and the like with
            "true" for "extended".
        label: for people.
        setup: of the model.
        predictions: of each sequence.
        network: what is known of the network on top, if any.
    """

    name: str
    label: str
    setup: Setup
    predictions: Sequence[Prediction]
    network: Mapping[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class _Paper:
    """The paper's metric of k pushes under m models: sums over frames (k, m) [m], and frames
    (k,)."""

    sums: FloatArray
    frames: FloatArray

    def means(self, rows: IntArray) -> FloatArray:
        """(d, m) [m] of pushes drawn with repetition (d, n)."""
        frames = np.maximum(self.frames[rows].sum(axis=1), 1)
        return np.asarray(self.sums[rows].sum(axis=1) / frames[:, None])


def build_ladder(
    data: Sequence[Observations],
    rungs: Sequence[Rung],
    kinds: Mapping[str, str],
    trained: Collection[str],
    *,
    ends: tuple[int, int] = (0, -1),
    seed: int = 0,
) -> dict[str, Any]:
    """All rungs on the same patches of the same pushes, as plain values, lengths in mm.

    Args:
        rungs: the baseline first.
        kinds: of each push.
        trained: kinds that networks and causes were fitted on.
        ends: the two physical models along whose difference the camera's fixed pattern is an error
            (`palpate.diagnosis.gain.probe_errors`): what a network learns of the camera's own
            pattern counts for nothing there.

    Frames from a sequence's first touch on count; what those before it show is the camera's fixed
    pattern. Of each model: its error, and the share of the reducible error that it removes; the
    same of the part that is `moving`, which leaves out what is as wrong in the untouched block; and
    the paper's metric. Intervals (95 %) are of resampled pushes.

    Raises DiagnosisError where no push was seen.
    """
    models = [rung.predictions for rung in rungs]
    # Always lasting: no stated setup says that a push will leave a dent or a block that slid, and
    # where one did, the frames after it hold no camera's pattern. Taken for one, it is charged to
    # whoever corrects the slide while the tool tells of it.
    sums = probe_sums(data, models, True, ends)
    paper = _paper(data, rungs, sums.names)
    names, parts = [rung.name for rung in rungs], []
    for part, name, rows in _parts(sums.names, kinds, trained):
        parts.append(
            {
                "part": part,
                "name": name,
                "kinds": sorted({kinds.get(sums.names[row], "?") for row in rows}),
                "probes": len(rows),
                **_judged(names, sums.of(rows), _Paper(paper.sums[rows], paper.frames[rows]), seed),
            }
        )
    return {
        "unit": "mm",
        "trained_kinds": sorted(trained),
        "rungs": [
            {"name": rung.name, "label": rung.label, "network": rung.network} for rung in rungs
        ],
        "parts": parts,
    }


def _parts(
    names: Sequence[str], kinds: Mapping[str, str], trained: Collection[str]
) -> list[tuple[str, str, list[int]]]:
    """What is told apart: (part, name, rows of the pushes)."""
    found: dict[tuple[str, str], list[int]] = {}
    for row, name in enumerate(names):
        kind, sequence = kinds.get(name, "?"), name.rpartition("/")[0]
        seen = "seen" if kind in trained else "unseen"
        for key in (("all", "all"), (seen, seen), ("kind", kind), ("sequence", sequence)):
            found.setdefault(key, []).append(row)
    if not found:
        raise DiagnosisError("no push was seen; name other sequences in [splits] test")
    return [
        (part, name, rows)
        for (part, name), rows in sorted(
            found.items(), key=lambda one: (_ORDER.index(one[0][0]), one[0][1])
        )
    ]


def _judged(names: Sequence[str], sums: ProbeSums, paper: _Paper, seed: int) -> dict[str, Any]:
    """Errors, removed shares and the paper's metric of one part, and what each later rung removes
    beyond the second.
    """
    draws = sums.draws(seed)
    whole, drawn = sums.rms()[0], sums.rms(draws)
    moving, drawn_moving = sums.rms(still=False)[0], sums.rms(draws, still=False)
    mean, drawn_mean = paper.means(np.arange(len(sums.names))[None])[0], paper.means(draws)
    (share, drawn_share), (share_moving, drawn_moving_share) = (
        _shares(whole, drawn),
        _shares(moving, drawn_moving),
    )
    nearer, drawn_nearer = _nearer(mean), _nearer(drawn_mean)
    errors = {}
    for number, name in enumerate(names):
        errors[name] = {
            "error": _mm(whole[number]),
            **dict(zip(("low", "high"), map(_mm, _ends(drawn[:, number])), strict=True)),
            "removed": _interval(float(share[number]), drawn_share[:, number]),
            "moving": {
                "error": _mm(moving[number]),
                "removed": _interval(float(share_moving[number]), drawn_moving_share[:, number]),
            },
            "paper": {
                "error": _mm(mean[number]),
                "improvement": _interval(nearer[number], drawn_nearer[:, number]),
            },
        }
    beyond = {
        name: {
            "removed": _interval(
                float(share[number] - share[1]), drawn_share[:, number] - drawn_share[:, 1]
            ),
            "paper": _interval(
                nearer[number] - nearer[1], drawn_nearer[:, number] - drawn_nearer[:, 1]
            ),
        }
        for number, name in enumerate(names[2:], 2)
    }
    return {"noise_floor": _mm(whole[-1]), "errors": errors, "beyond_second": beyond}


def _nearer(distances: FloatArray) -> FloatArray:
    """Share of the first model's mean distance that is gone (..., m); none where no frame was
    touched, so none was measured.
    """
    first = distances[..., :1]
    return np.where(first > 0, 1 - distances / np.where(first > 0, first, 1.0), 0.0)


def _shares(whole: FloatArray, drawn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of the reducible error what each model removes (m,), and of each draw (d, m); the last column
    is the noise floor's.
    """
    share = removed_share(whole[0], whole[:-1], whole[-1])
    return share, removed_share(drawn[:, :1], drawn[:, :-1], drawn[:, -1:])


def _paper(data: Sequence[Observations], rungs: Sequence[Rung], names: Sequence[str]) -> _Paper:
    found = [paper_sums(data, rung.predictions, rung.setup) for rung in rungs]
    sums = np.array([[own.get(name, (0.0, 0))[0] for own in found] for name in names])
    return _Paper(sums, np.array([float(found[0].get(name, (0.0, 0))[1]) for name in names]))


def _mm(value: float) -> float:
    return round(float(value) * 1e3, _DIGITS)


def _ends(drawn: FloatArray) -> tuple[float, float]:
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def _interval(value: float | FloatArray, drawn: FloatArray) -> dict[str, float]:
    low, high = _ends(drawn)
    return {
        "value": round(float(value), _DIGITS),
        "low": round(low, _DIGITS),
        "high": round(high, _DIGITS),
    }
