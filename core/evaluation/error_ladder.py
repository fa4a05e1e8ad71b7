"""The error ladder: errors of several models, with and without a network, on the same pushes.

Errors are reported over all pushes, by sequence, and by kind of motion.
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
"""Decimals of reported values."""
_ORDER = ("all", "seen", "unseen", "kind", "sequence")


@dataclass(frozen=True, eq=False, kw_only=True)
class Rung:
    """One model of the ladder.

    Attributes:
        name: "baseline", "extended" or "true"; with a network on top "baseline_network" and so on.
        label: name for readers.
        setup: the setup of the model.
        predictions: one prediction per sequence.
        network: description of the network on top; None without one.
    """

    name: str
    label: str
    setup: Setup
    predictions: Sequence[Prediction]
    network: Mapping[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class _Paper:
    """The paper's metric of k pushes under m models.

    Attributes:
        sums: (k, m) sums over the frames of each push [m].
        frames: (k,) number of frames of each push.
    """

    sums: FloatArray
    frames: FloatArray

    def means(self, rows: IntArray) -> FloatArray:
        """Return mean distances (d, m) [m] over draws (d, n) of pushes."""
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
    """Compare all rungs on the same patches of the same pushes; return plain values in mm.

    Each model has its error and the share of the reducible error that it removes; the same for the
    `moving` part, which leaves out the error that the untouched block shows as well; and the
    paper's metric. Intervals (95 %) are from resampled pushes. Frames count from the first touch of
    a sequence on; the frames before it give the camera's fixed pattern.

    Args:
        data: the observations of each sequence.
        rungs: the models, the baseline first.
        kinds: kind of motion of each push.
        trained: kinds of motion that networks and causes were fitted on.
        ends: numbers of the two physical models along whose difference the camera's fixed pattern
            counts as an error (`palpate.diagnosis.gain.probe_errors`). A network gets no credit
            for learning the rest of the pattern.
        seed: seed of the resampling.

    Raises DiagnosisError where no push was observed.
    """
    models = [rung.predictions for rung in rungs]
    # `lasting` is always true: no setup states whether a push leaves a dent or a displaced block,
    # and frames after such a push do not show the camera's pattern alone.
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
                **_part_result(
                    names, sums.of(rows), _Paper(paper.sums[rows], paper.frames[rows]), seed
                ),
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
    """Return the parts to report: (part, name, numbers of the pushes)."""
    parts: dict[tuple[str, str], list[int]] = {}
    for row, name in enumerate(names):
        kind, sequence = kinds.get(name, "?"), name.rpartition("/")[0]
        seen = "seen" if kind in trained else "unseen"
        for key in (("all", "all"), (seen, seen), ("kind", kind), ("sequence", sequence)):
            parts.setdefault(key, []).append(row)
    if not parts:
        raise DiagnosisError("no push was observed; name other sequences in [splits] test")
    return [
        (part, name, rows)
        for (part, name), rows in sorted(
            parts.items(), key=lambda one: (_ORDER.index(one[0][0]), one[0][1])
        )
    ]


def _part_result(names: Sequence[str], sums: ProbeSums, paper: _Paper, seed: int) -> dict[str, Any]:
    """Return errors, removed shares and the paper's metric of one part.

    For rungs after the second also the difference of their shares to the second's.
    """
    draws = sums.draws(seed)
    whole, drawn = sums.rms()[0], sums.rms(draws)
    moving, drawn_moving = sums.rms(still=False)[0], sums.rms(draws, still=False)
    mean, drawn_mean = paper.means(np.arange(len(sums.names))[None])[0], paper.means(draws)
    (share, drawn_share), (share_moving, drawn_moving_share) = (
        _shares(whole, drawn),
        _shares(moving, drawn_moving),
    )
    improvement, drawn_improvement = _improvement(mean), _improvement(drawn_mean)
    errors = {}
    for number, name in enumerate(names):
        errors[name] = {
            "error": _mm(whole[number]),
            **dict(zip(("low", "high"), map(_mm, _quantiles(drawn[:, number])), strict=True)),
            "removed": _interval(float(share[number]), drawn_share[:, number]),
            "moving": {
                "error": _mm(moving[number]),
                "removed": _interval(float(share_moving[number]), drawn_moving_share[:, number]),
            },
            "paper": {
                "error": _mm(mean[number]),
                "improvement": _interval(improvement[number], drawn_improvement[:, number]),
            },
        }
    beyond = {
        name: {
            "removed": _interval(
                float(share[number] - share[1]), drawn_share[:, number] - drawn_share[:, 1]
            ),
            "paper": _interval(
                improvement[number] - improvement[1],
                drawn_improvement[:, number] - drawn_improvement[:, 1],
            ),
        }
        for number, name in enumerate(names[2:], 2)
    }
    return {"noise_floor": _mm(whole[-1]), "errors": errors, "beyond_second": beyond}


def _improvement(distances: FloatArray) -> FloatArray:
    """Return the share of the first model's mean distance that each model removes (..., m).

    Zero where no frame has a contact.
    """
    first = distances[..., :1]
    return np.where(first > 0, 1 - distances / np.where(first > 0, first, 1.0), 0.0)


def _shares(whole: FloatArray, drawn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the share of the reducible error that each model removes: (m,), and by draw (d, m).

    The last column of `whole` and `drawn` is the noise floor.
    """
    share = removed_share(whole[0], whole[:-1], whole[-1])
    return share, removed_share(drawn[:, :1], drawn[:, :-1], drawn[:, -1:])


def _paper(data: Sequence[Observations], rungs: Sequence[Rung], names: Sequence[str]) -> _Paper:
    by_rung = [paper_sums(data, rung.predictions, rung.setup) for rung in rungs]
    sums = np.array([[own.get(name, (0.0, 0))[0] for own in by_rung] for name in names])
    return _Paper(sums, np.array([float(by_rung[0].get(name, (0.0, 0))[1]) for name in names]))


def _mm(value: float) -> float:
    return round(float(value) * 1e3, _DIGITS)


def _quantiles(drawn: FloatArray) -> tuple[float, float]:
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def _interval(value: float | FloatArray, drawn: FloatArray) -> dict[str, float]:
    low, high = _quantiles(drawn)
    return {
        "value": round(float(value), _DIGITS),
        "low": round(low, _DIGITS),
        "high": round(high, _DIGITS),
    }
