from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace

import pytest

from palpate.blind import (
    KINDS,
    MIX,
    SHAPED,
    Case,
    all_cases,
    draw_cases,
    drawn_of,
    scenario_of,
    with_nuisances,
    with_shapes,
)
from palpate.blind.cases import ALIKE, LOCATED
from palpate.effects import DIAGNOSED
from palpate.foundation.errors import RunError
from palpate.synthetic import (
    DISTURBANCES,
    FAMILIES,
    FAULTS,
    FILTERS,
    HIDDEN,
    OF_ANY_BODY,
    ON_SHAPES,
    QUICK,
    ROBOT_RELATIONS,
    SHORT_PROTOCOL,
    WEIGHED,
    WEIGHED_DISTURBANCES,
    ShapeScenario,
)

FILTERS_USED = set(FILTERS.values())


def effects_of(cases: list[Case]) -> list[str]:
    return [case.hidden[0] for case in cases if case.kind == "clear"]


def test_small_suite_has_each_effect_and_disturbance_once_and_ten_controls() -> None:
    cases = all_cases(seed=3)
    assert [case.hidden for case in cases if case.hidden] == [
        (name,) for name in (*WEIGHED, *WEIGHED_DISTURBANCES)
    ]
    assert sum(case.kind == "control" for case in cases) == 10
    assert len({case.name for case in cases}) == len({case.seed for case in cases}) == len(cases)


def test_requested_effects_are_hidden_and_do_not_change_other_cases() -> None:
    everything = all_cases(seed=3, effects=list(HIDDEN))
    assert effects_of(everything) == list(HIDDEN)
    assert {case for case in all_cases(seed=3) if case.kind != "outside"} <= set(everything)
    assert len({case.seed for case in everything}) == len(everything)
    with pytest.raises(RunError, match="cannot hide moon; it knows poisson_ratio"):
        all_cases(seed=3, effects=["moon"])


def test_bench_hides_what_a_diagnosis_weighs_but_for_the_replays_own_grid() -> None:
    assert {effect.name for effect in DIAGNOSED} - set(HIDDEN) == {"mesh_resolution"}
    # Suites of old seeds stay what they are: these are hidden where they are asked for.
    asked = {"stiff_tube", "geometry_local"}
    assert {effect.name for effect in DIAGNOSED} & set(HIDDEN) - set(WEIGHED) == asked
    assert set(WEIGHED) <= {effect.name for effect in DIAGNOSED} and set(QUICK) < set(WEIGHED)


def test_drawn_suite_has_its_mix() -> None:
    assert sum(MIX.values()) == pytest.approx(1.0) and set(MIX) == set(KINDS)
    cases = draw_cases(5, 200)
    counted = Counter(case.kind for case in cases)
    assert {kind: counted[kind] for kind in KINDS} == {
        kind: round(200 * MIX[kind]) for kind in KINDS
    }
    assert counted["control"] == 50
    assert len({case.name for case in cases}) == len({case.seed for case in cases}) == 200


def test_larger_suite_begins_with_the_smaller_one_and_another_seed_is_another_suite() -> None:
    assert draw_cases(5, 200)[:30] == draw_cases(5, 30)
    assert not set(draw_cases(5, 30)) & set(draw_cases(6, 30))


def test_each_effect_comes_once_before_any_comes_again() -> None:
    drawn = effects_of(draw_cases(5, 2 * len(WEIGHED), kinds=["clear"]))
    assert sorted(drawn[: len(WEIGHED)]) == sorted(drawn[len(WEIGHED) :]) == sorted(WEIGHED)
    pairs = [case.hidden for case in draw_cases(5, 30, kinds=["pair"])]
    assert len(set(pairs)) == 30 and all(len(set(pair)) == 2 for pair in pairs)


def test_kinds_effects_and_controls_are_as_requested() -> None:
    cases = draw_cases(5, 20, kinds=["pair", "clear"], effects=["gravity", "tool_radius"])
    assert {case.kind for case in cases} == {"pair", "clear"}
    assert {name for case in cases for name in case.hidden} == {"gravity", "tool_radius"}
    assert Counter(case.kind for case in draw_cases(5, 20, kinds=["clear"], controls=5)) == {
        "clear": 15,
        "control": 5,
    }
    assert {case.hidden[0] for case in draw_cases(5, 10, kinds=["twins"])} <= set(ALIKE)


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"kinds": ["moon"]}, "no kind of case is called 'moon'; known are control, clear"),
        ({"effects": ["moon"]}, "cannot hide moon"),
        ({"controls": 21}, "21 controls are more than the 20 scenarios"),
        ({"kinds": ["twins"], "effects": ["gravity"]}, "gravity gives no case of the kind twins"),
        ({"kinds": ["pair"], "effects": ["gravity"]}, "gravity gives no case of the kind pair"),
        ({"kinds": ["control"], "controls": 3}, "no kind of case is left"),
    ],
)
def test_impossible_request_is_an_error(request_: dict[str, list[str]], message: str) -> None:
    with pytest.raises(RunError, match=message):
        draw_cases(5, 20, **request_)  # type: ignore[arg-type]


@pytest.mark.parametrize("effect", HIDDEN)
def test_case_hides_its_effect_and_the_same_one_each_time(effect: str) -> None:
    case = Case("case", 7, "clear", (effect,))
    scenario = scenario_of(case)
    assert [hidden.effect for hidden in scenario.effects] == [effect]
    assert scenario == scenario_of(case)
    assert scenario != scenario_of(Case("case", 8, "clear", (effect,)))


def test_case_hides_the_same_whatever_else_is_weighed() -> None:
    cases = all_cases(7, 0, ["gravity", "poisson_ratio"])
    drawn = {case.hidden[0]: dict(scenario_of(case).effects[0].parameters) for case in cases}
    assert drawn == {
        "gravity": {"specific_weight_over_stiffness": 2.92},
        "poisson_ratio": {"nu": 0.121},
    }


def test_subtle_case_hides_a_share_of_a_clear_one() -> None:
    clear, subtle = (
        scenario_of(Case("case", 7, kind, ("time_offset",))).effects[0]
        for kind in ("clear", "subtle")
    )
    assert subtle.value("offset") == pytest.approx(0.4 * clear.value("offset"), abs=1e-6)


def test_control_hides_nothing() -> None:
    scenario = scenario_of(Case("control", 1, "control"))
    assert scenario.effects == () and scenario.disturbances == ()


def test_pair_hides_both() -> None:
    scenario = scenario_of(Case("case", 7, "pair", ("gravity", "tool_radius")))
    assert {hidden.effect for hidden in scenario.effects} == {"gravity", "tool_radius"}


@pytest.mark.parametrize("name", DISTURBANCES)
def test_case_outside_the_catalogue_hides_no_effect(name: str) -> None:
    scenario = scenario_of(Case("case", 7, "outside", (name,)))
    assert scenario.effects == () and [one.name for one in scenario.disturbances] == [name]


def test_offset_among_look_alikes_is_vertical_and_as_long() -> None:
    clear, twin = (
        scenario_of(Case("case", 7, kind, ("tool_offset",))).effects[0]
        for kind in ("clear", "twins")
    )
    length = sum(clear.value(name) ** 2 for name in ("dx", "dy", "dz")) ** 0.5
    assert (twin.value("dx"), twin.value("dy")) == (0.0, 0.0)
    assert twin.value("dz") * clear.value("dz") > 0 and abs(twin.value("dz")) == pytest.approx(
        length, abs=1e-5
    )


def test_modulus_alone_differs_from_what_is_believed_by_a_quarter_or_more() -> None:
    for case in draw_cases(5, 10, kinds=["modulus"]):
        scenario = scenario_of(case)
        assert [hidden.effect for hidden in scenario.effects] == ["young_modulus"]
        assert not 0.75 < scenario.true_modulus / scenario.young_modulus < 1.25


def test_short_case_records_fewer_sequences_of_the_same() -> None:
    (long,), (short,) = (draw_cases(5, 1, short=short) for short in (False, True))
    assert scenario_of(short).sequences == SHORT_PROTOCOL != scenario_of(long).sequences
    assert scenario_of(short).effects == scenario_of(long).effects
    assert Case.from_json(short.to_json()) == short


def test_nuisances_leave_what_is_hidden_alone() -> None:
    plain = draw_cases(3, 12)
    cases = with_nuisances(plain)
    assert [replace(scenario_of(case), nuisances=(), declared_filters=()) for case in cases] == [
        scenario_of(case) for case in plain
    ]
    filtered = [
        one for one in map(scenario_of, cases) if FILTERS_USED & set(map(type, one.nuisances))
    ]
    assert {bool(one.declared_filters) for one in filtered} == {True, False}
    assert all(scenario_of(case).nuisances for case in cases)
    assert {case.noisy for case in cases} == {True, False}


def test_a_case_with_nuisances_goes_to_a_row_and_back() -> None:
    plain = draw_cases(3, 2)
    assert not {"nuisances", "camera", "filters"} & set(plain[0].to_json())
    for case in [*plain, *with_nuisances(plain, "d405", ["spatial"]), *with_nuisances(plain)]:
        assert Case.from_json(json.loads(json.dumps(case.to_json()))) == case


def test_unknown_cameras_are_refused_before_anything_runs() -> None:
    with pytest.raises(RunError, match="no camera 'd999'"):
        with_nuisances(draw_cases(3, 2), "d999")


def test_faults_are_drawn_where_they_are_asked_for() -> None:
    assert not any(case.kind == "fault" for case in draw_cases(3, 200))
    cases = draw_cases(3, 6, ["fault"])
    assert {case.hidden[0] for case in cases} == set(FAULTS)
    for case in cases:
        kinds = {type(one).__name__ for one in scenario_of(case).nuisances}
        assert kinds & set(FAULTS) == set(case.hidden)


def test_drawn_suite_on_shapes_has_its_mix_and_every_family_relation_and_view() -> None:
    cases = draw_cases(5, 60, shapes=True)
    assert Counter(case.kind for case in cases) == SHAPED
    assert sum(SHAPED.values()) == 60
    assert len({case.name for case in cases}) == len({case.seed for case in cases}) == 60
    for kind, number in SHAPED.items():
        own = [case for case in cases if case.kind == kind]
        for every, counted in (
            (FAMILIES, Counter(case.shape for case in own)),
            (ROBOT_RELATIONS, Counter(case.robot for case in own)),
            ((True, False), Counter(case.table for case in own)),
        ):
            assert set(counted) == set(every)
            assert max(counted.values()) - min(counted.values()) <= 1, (kind, number)
    assert draw_cases(5, 60, shapes=True)[:13] == draw_cases(5, 13, shapes=True)


def test_clear_cases_on_shapes_hide_every_effect_and_lumps_and_tubes_three_times() -> None:
    clear = [case for case in draw_cases(5, 60, shapes=True) if case.kind == "clear"]
    counted = Counter(case.hidden[0] for case in clear[: len(ON_SHAPES) + 4])
    assert set(counted) == set(ON_SHAPES)
    assert {name for name, count in counted.items() if count == 3} == set(LOCATED)
    chosen = draw_cases(5, 6, ["clear"], ["gravity", "stiff_tube"], shapes=True)
    assert Counter(effects_of(chosen)) == {"gravity": 3, "stiff_tube": 3}


def test_cases_of_shapes_are_the_same_each_time() -> None:
    for case in draw_cases(5, 8, shapes=True):
        drawn = drawn_of(case)
        assert isinstance(drawn, ShapeScenario)
        hidden = (*drawn.scenario.effects, *drawn.scenario.disturbances)
        names = {getattr(one, "effect", None) or getattr(one, "name", None) for one in hidden}
        assert names == set(case.hidden)
        assert (drawn.family, drawn.robot, drawn.table) == (case.shape, case.robot, case.table)
        assert Case.from_json(json.loads(json.dumps(case.to_json()))) == case
        assert drawn_of(case) == drawn
    assert not {"shape", "robot", "table"} & set(draw_cases(5, 1)[0].to_json())


def test_cases_outside_the_catalogue_on_shapes_hide_what_any_body_can_have() -> None:
    outside = [case for case in draw_cases(5, 60, shapes=True) if case.kind == "outside"]
    assert {case.hidden for case in outside} == {(name,) for name in OF_ANY_BODY}


@pytest.mark.parametrize(
    ("case", "message"),
    [
        (Case("a", 1, "outside", ("second_body",)), "has no second_body on a shape"),
        (Case("a", 1, "clear", ("landmark_mismatch",)), "has no landmark_mismatch on a shape"),
        (Case("a", 1, "subtle", ("gravity",)), "has no subtle on a shape"),
        (Case("a", 1, "control", nuisances=True), "has no nuisances on a shape"),
    ],
)
def test_cases_that_no_shape_can_be_are_refused(case: Case, message: str) -> None:
    with pytest.raises(RunError, match=message):
        with_shapes([case], 5)
