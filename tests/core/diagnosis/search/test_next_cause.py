from __future__ import annotations

import numpy as np
import pytest
from pushed_block import SETUP

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.residual_structure import Structure
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.forward_selection import _refits_nonlinear
from palpate.diagnosis.search.required_gain import (
    gain_to_try,
    removes_misfit,
    removes_structure,
    required_gain,
)
from palpate.effects.support import BaseCompliance
from palpate.effects.time_dependence import Viscoelasticity

STATED = Model((), SETUP, (), (), ModelColumns(()))
SOFT = Model((BaseCompliance(stiffness_over_E=41.0),), SETUP, (), (), ModelColumns(()))
QUIET, LOUD = Structure(75.0, 100.0, 140.0), Structure(300.0, 100.0, 140.0)


def test_first_cause_must_gain_what_chance_alone_does_not():
    assert required_gain(Findings(STATED, bound=31.0), Trial(STATED, 0.0, 1.2), "gravity") == 31.0


def _second(first: float) -> float:
    return required_gain(Findings(STATED, remaining=QUIET), Trial(SOFT, first, 1.06), "gravity")


def test_second_cause_may_show_a_fifth_of_what_the_first_does():
    """A soft base of 2508 nats and touches of other places, 484 more, on the virtual bench."""
    assert _second(2508.0) < 484.0


@pytest.mark.parametrize(
    ("only", "best"),
    [(3389.0, 5.1), (14780.0, 6.1), (3252.0, 34.7), (3675.0, 8.8), (694.0, 20.4), (194.0, 37.0)],
)
def test_nothing_is_named_beside_an_only_cause(only: float, best: float):
    """What the best of the catalogue gained on top of it, on the virtual bench and on data of
    another solver.
    """
    assert _second(only) > best


def test_where_structure_is_left_a_faint_cause_must_remove_most_of_it():
    """Beside a gel and a tool off its place, whose law is another, a set of 144 nats removes a
    tenth of the structure: 2.81 to 2.63 of chance.
    """
    before = Structure(281.0, 100.0, 142.0)
    assert not removes_structure(before, Structure(263.0, 100.0, 142.0))
    assert removes_structure(before, Structure(185.0, 100.0, 142.0))
    assert not removes_structure(QUIET, Structure(10.0, 100.0, 140.0))  # there is none
    findings, pair = Findings(STATED, remaining=before), Trial(SOFT, 20_432.0, 0.74)
    assert required_gain(findings, pair, "permanent_set") > 144.0
    assert required_gain(findings, pair, "permanent_set", True) == 2 * CRITERIA.naming.least_gain


def test_faint_second_cause_that_removes_the_rest_is_let_in():
    """A relaxing gel of 11 000 nats removes 93 %, a tool that is off its place the rest."""
    first = Trial(SOFT, 11_000.0, 1.08)
    whole, half = Trial(SOFT, 11_400.0, 1.01), Trial(SOFT, 11_400.0, 1.05)
    assert removes_misfit(first, whole) and not removes_misfit(first, half)
    clean = Trial(SOFT, 11_000.0, 0.98)
    assert not removes_misfit(clean, Trial(SOFT, 11_060.0, 0.97))  # there is no rest
    findings = Findings(STATED, remaining=QUIET)
    asked = [
        required_gain(findings, first, "tool_offset", removes_misfit(first, trial))
        for trial in (whole, half)
    ]
    assert asked[0] == 2 * CRITERIA.naming.least_gain < 400.0 < asked[1]


def test_beside_history_a_cause_must_promise_what_can_name_it():
    """A gel of 7797 nats whose misfit of 1.023 is of another law: 60 nats name nothing there."""
    history = Model(
        (Viscoelasticity(relaxed_fraction=0.7, time_constant=1.1),),
        SETUP,
        (),
        (Block("poke", np.eye(1), 25_000.0), Block("rest", np.eye(1), 900.0)),
        ModelColumns(()),
    )
    findings, gel = Findings(STATED, remaining=QUIET), Trial(history, 7797.0, 1.023)
    lowest = required_gain(findings, gel, "permanent_set", True)
    asked = gain_to_try(findings, gel, "permanent_set")
    assert asked == pytest.approx(0.5 * 0.023 * 25_000 / 2) and lowest < 60.0 < asked
    assert removes_misfit(gel, Trial(history, 7797.0 + asked, 1.023 - 2 * asked / 25_000))
    loud, clean = Findings(STATED, remaining=LOUD), Trial(history, 7797.0, 0.99)
    structured = 0.5 * (LOUD.value - LOUD.expected) / 2
    assert gain_to_try(loud, gel, "permanent_set") == max(lowest, structured)
    whole = required_gain(findings, clean, "permanent_set")
    assert gain_to_try(findings, clean, "permanent_set") == whole
    soft = Trial(SOFT, 7797.0, 1.023)  # trials without history are cheap
    assert gain_to_try(findings, soft, "permanent_set") == lowest


def test_nonlinear_effects_are_refitted_beside_a_cause_only_where_another_might_be_named():
    needed = _second(994.0)
    least = CRITERIA.naming.promising * needed
    quiet, promising = np.array([3.0, 0.9 * least]) > least, np.array([3.0, 1.1 * least]) > least
    assert _refits_nonlinear(Findings(STATED), Trial(STATED, 0.0, 1.2), quiet)
    soft = Trial(SOFT, 994.0, 1.06)
    assert not _refits_nonlinear(Findings(STATED, remaining=QUIET), soft, quiet)
    assert _refits_nonlinear(Findings(STATED, remaining=QUIET), soft, promising)
    assert _refits_nonlinear(Findings(STATED, remaining=LOUD), soft, quiet)
    assert not _refits_nonlinear(Findings(STATED, remaining=QUIET), soft, np.empty(0, dtype=bool))
