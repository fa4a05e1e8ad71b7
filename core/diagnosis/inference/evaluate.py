"""Hypotheses in which something is remembered: replayed along the tool's whole way once, and varied
by traces.

The trace of friction says how far the tool drags the surface, but not which part of the contact
slips first: what a little more of it changes has a correlation of less than 0.85 with its trace,
and is told by one more replay along the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from palpate.diagnosis.forward.history_columns import moved, moves, with_traces
from palpate.diagnosis.forward.history_replay import TRACED
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.effect_derivative import Tangent
from palpate.effects import Effect
from palpate.effects.tool import ToolFriction
from palpate.setup.setup import Inclusion

if TYPE_CHECKING:
    from palpate.diagnosis.inference.inference_problem import Bench

__all__ = ["led"]


def led(
    bench: Bench,
    effects: Sequence[Effect],
    starts: Sequence[Prediction] | None,
    tangents: Sequence[Tangent],
    lumps: Sequence[Inclusion],
) -> list[Prediction]:
    """Predictions with the columns of a replay that remembers nothing, and with traces of what is
    remembered.

    From one size of what is remembered to the next the replay without it is the same, and is taken
    from those the bench has.
    """
    pending = bench.predict(effects, None, starts)
    others = tuple(effect for effect in effects if not isinstance(effect, TRACED))
    known = [] if tangents or lumps else [model for model in bench.known if model.effects == others]
    plain = known[0] if known else bench.evaluate(others, starts, tangents, lumps)
    traces = bench.workers.trace(
        bench.names, plain.setup, bench.grid, plain.predictions, moves(effects)
    )
    first, extra = len(bench.nuisances.precision) - 1, len(tangents) + len(lumps)
    rows = zip(pending, plain.predictions, traces, strict=True)
    found = [
        with_traces(one.result(), base, own.result(), effects, first, extra)
        for one, base, own in rows
    ]
    column = first
    for index, effect in enumerate(effects):
        if isinstance(effect, ToolFriction):
            other, step = moved(effect, 0)
            there = [
                one.result()
                for one in bench.predict(
                    [*effects[:index], other, *effects[index + 1 :]], None, starts
                )
            ]
            found = [
                here.replace_column(one, column, step)
                for here, one in zip(found, there, strict=True)
            ]
        column += len(effect.numbers())
    return found
