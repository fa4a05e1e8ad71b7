from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import SETUP

from palpate.diagnosis.gain.surface_gain import SurfaceGain
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.residual_structure import Structure
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.validation.rejection import rejection_reason
from palpate.effects.geometry import GeometryScale
from palpate.effects.tool import ToolCompliance

LADDER = SurfaceGain(
    baseline=1.92e-3,
    extended=0.61e-3,
    noise_floor=0.55e-3,
    removed=(0.956, 0.93, 0.98),
    paper=(2.4e-3, 1.3e-3),
    probes=9,
)
IDLE = replace(LADDER, removed=(-0.03, -0.11, 0.03))


def _structure(ratio: float) -> Structure:
    """So many times what chance gives, whose bound is 1.4 times that."""
    return Structure(100.0 * ratio, 100.0, 140.0)


def _found(before: float, left: float) -> Findings:
    cause = ToolCompliance(compliance_times_stiffness=59.0)
    models = [Model(effects, SETUP, (), (), ModelColumns(())) for effects in ((), (cause,))]
    return Findings(
        models[0],
        best=Trial(models[1], 564.0, 1.4),
        structure=_structure(before),
        remaining=_structure(left),
    )


@pytest.mark.parametrize(
    "removed", [(0.9, 0.8, 0.95), (0.0, 0.0, 0.0), (-0.3, -0.9, 0.1), (-0.05, -0.08, -0.02)]
)
def test_cause_that_leaves_no_structure_is_not_rejected(removed):
    assert rejection_reason(_found(3.0, 1.2), replace(LADDER, removed=removed)) == ""


def test_cause_that_leaves_structure_and_has_no_gain_is_rejected():
    why = rejection_reason(_found(5.0, 5.4), IDLE)
    assert why.startswith("tool_compliance would explain part")
    assert (
        "5.4 times what chance gives, 5.0 times without it" in why
        and "-3 % (-11 to 3 %) is removed" in why
    )


def test_cause_that_leaves_structure_is_rejected_without_held_out_sequences():
    assert "stays" in rejection_reason(_found(5.0, 5.4), None)


def test_cause_that_removes_most_of_structure_or_error_is_not_rejected():
    assert rejection_reason(_found(20.0, 3.0), IDLE) == ""
    assert rejection_reason(_found(5.0, 4.6), replace(LADDER, removed=(0.6, 0.5, 0.7))) == ""


def test_cause_that_leaves_most_of_structure_and_error_is_rejected():
    why = rejection_reason(_found(2.2, 1.9), replace(LADDER, removed=(0.29, 0.23, 0.47)))
    assert (
        "1.9 times what chance gives, 2.2 times without it" in why
        and "29 % (23 to 47 %) is removed" in why
    )


def test_cause_that_adds_error_where_none_is_to_remove_is_rejected():
    none = replace(LADDER, baseline=0.13e-3, removed=(0.0, 0.0, 0.0), added=0.4e-3)
    why = rejection_reason(_found(3.0, 1.2), replace(none, extended=0.72e-3))
    assert "their error grows from 0.13 to 0.72 mm, surely by 0.4 mm" in why
    assert rejection_reason(_found(3.0, 1.2), replace(none, added=0.05e-3)) == ""


def test_no_cause_needs_no_rejection():
    assert rejection_reason(Findings(_found(1.0, 1.0).baseline), LADDER) == ""


@pytest.mark.parametrize(
    ("gain", "before", "removed", "named"),
    [
        (31.0, 1.0, (0.2, -0.69, 0.36), False),
        (31.0, 1.0, (0.2, 0.01, 0.36), True),
        (31.0, 3.0, (0.2, -0.69, 0.36), True),
        (384.0, 1.0, (0.0, 0.0, 0.0), True),
        (54.0, 1.0, (0.08, 0.0, 0.11), False),
    ],
)
def test_gain_that_nothing_confirms_is_a_hint(gain, before, removed, named):
    findings = _found(before, 1.0)
    assert findings.best is not None
    findings.best = replace(findings.best, gain=gain, required_gain=25.0)
    why = rejection_reason(findings, replace(LADDER, removed=removed))
    assert (why == "") is named
    if not named:
        assert f"by {gain:.0f} nats" in why
        assert ("20 % (-69 to 36 %)" in why) == (gain == 31.0)
        findings.withdraw(why)
        assert findings.hints == {"tool_compliance": why}


@pytest.mark.parametrize(("at_rest", "named"), [(20.0, True), (4.0, False), (-7.0, False)])
def test_cause_that_touches_or_the_rest_cloud_show_needs_no_push_to_confirm_it(at_rest, named):
    findings = _found(1.0, 1.0)
    assert findings.best is not None
    cause = GeometryScale(scale_x=1.0, scale_y=1.04, scale_z=1.0)
    blocks = tuple(Block(name, np.zeros((1, 1)), 1.0) for name in ("poke-01", "rest"))
    model = replace(findings.best.model, effects=(cause,), blocks=blocks)
    parts = (30.0 - at_rest, at_rest, 1.0)
    findings.best = Trial(model, 31.0, 1.4, parts=parts, required_gain=25.0)
    assert (rejection_reason(findings, IDLE) == "") is named


def _faint(gain: float, ratio: float) -> Findings:
    findings = _found(ratio, ratio)
    assert findings.best is not None
    findings.best = replace(findings.best, gain=gain, required_gain=25.0)
    return findings


def test_cause_whose_numbers_may_be_as_stated_is_a_hint():
    why = rejection_reason(_faint(26.0, 0.9), LADDER, ("tool_compliance",))
    assert "26 nats" in why
    assert "include what is stated" in why


@pytest.mark.parametrize(
    ("gain", "ratio", "as_stated"),
    [(60.0, 0.9, ("tool_compliance",)), (26.0, 1.6, ("tool_compliance",)), (26.0, 0.9, ())],
    ids=["far above the bound", "structure is there", "numbers differ"],
)
def test_faint_cause_with_other_support_is_named(gain, ratio, as_stated):
    assert rejection_reason(_faint(gain, ratio), LADDER, as_stated) == ""
