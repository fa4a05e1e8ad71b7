"""The scenario that follows from a blind case's kind, hidden names and seed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from palpate.blind.cases import Case

if TYPE_CHECKING:
    from palpate.synthetic import Scenario, ShapeScenario

__all__ = ["drawn_of", "scenario_of"]


def drawn_of(case: Case) -> Scenario | ShapeScenario:
    """The scenario of a case, with its shape where it is no block."""
    from palpate.synthetic import draw_shape_scenario

    if case.shape is None:
        return scenario_of(case)
    effects = () if case.kind == "outside" else case.hidden
    disturbances = case.hidden if case.kind == "outside" else ()
    drawn = draw_shape_scenario(case.shape, len(effects), case.seed, effects, disturbances)
    return replace(drawn, robot=case.robot or "touches", table=case.table)


def scenario_of(case: Case) -> Scenario:
    """The scenario of a case, from its kind, its hidden names and its seed alone."""
    from palpate.synthetic import (
        FILTERS,
        SHORT_PROTOCOL,
        Scenario,
        draw_disturbance,
        draw_nuisances,
        draw_scenario,
    )
    from palpate.synthetic.laws import with_second_laws

    if case.kind in ("control", "fault"):
        scenario = Scenario()
    elif case.kind == "outside":
        scenario = Scenario(
            disturbances=tuple(draw_disturbance(name, case.seed) for name in case.hidden)
        )
    else:
        scenario = draw_scenario(
            case.seed, effects=len(case.hidden), clear=case.kind != "subtle", among=case.hidden
        )
    if case.kind == "twins":
        scenario = _pressing(scenario)
    # A slip of a millimetre is not noticed, and the block is not put back.
    scenario = replace(scenario, put_back=scenario.hidden("base_slip") is None)
    if case.nuisances or case.kind == "fault":
        drawn = draw_nuisances(
            case.seed,
            noisy=case.noisy,
            camera=case.camera,
            filters=case.filters,
            faults=case.hidden if case.kind == "fault" else (),
        )
        names = tuple(name for name, kind in FILTERS.items() if kind in map(type, drawn))
        # Every other user knows the settings of the camera's driver.
        declared = names if case.seed // 2 % 2 else ()
        scenario = replace(scenario, nuisances=drawn, declared_filters=declared)
    if case.nuisances:
        scenario = with_second_laws(scenario, case.seed)
    return replace(scenario, sequences=SHORT_PROTOCOL) if case.short else scenario


def _pressing(scenario: Scenario) -> Scenario:
    """Turn a hidden offset of the tool into the vertical, where it looks like others of ALIKE."""
    from palpate.synthetic import HiddenEffect

    offset = scenario.hidden("tool_offset")
    if offset is None:
        return scenario
    length = float(np.linalg.norm([offset.value(name) for name in ("dx", "dy", "dz")]))
    deeper = round(float(np.copysign(length, offset.value("dz"))), 5)
    return replace(
        scenario, effects=(HiddenEffect("tool_offset", {"dx": 0.0, "dy": 0.0, "dz": deeper}),)
    )
