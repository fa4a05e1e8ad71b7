from __future__ import annotations

import json

import numpy as np
import pytest
from linear_blocks import linear_blocks
from pushed_block import SETUP

from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.search.identifiability import detection_limits, identifiability_of, mimicry
from palpate.diagnosis.search.screening import Candidate, linear_gains, right_sides
from palpate.effects.elastic_material import StiffInclusion
from palpate.effects.load import Gravity
from palpate.effects.sensor import TimeOffset
from palpate.effects.tool import ToolOffset
from palpate.foundation.arrays import FloatArray

PER_METRE = 1e3
"""Columns of the nuisances are this many times larger than those of the causes, so that a tool's
offset can be theirs."""
NUISANCE, KNOWN = (0, 1, 2), np.diag([2.0, 1.0, 4.0]) * PER_METRE**2
BOUND = 25.0
TIME = Candidate(start=TimeOffset.neutral(SETUP), of=("offset",), columns=(3,), spread=(0.5,))
LUMP = Candidate(
    start=StiffInclusion.neutral(SETUP), of=("stiffness_ratio",), columns=(4,), spread=(2.0,)
)
FAR_LUMP = Candidate(
    start=StiffInclusion.neutral(SETUP), of=("stiffness_ratio",), columns=(6,), spread=(2.0,)
)
WEIGHT = Candidate(start=Gravity(specific_weight_over_stiffness=1.5), columns=(5,), spread=(1.0,))
OFFSET = Candidate(
    start=ToolOffset.neutral(SETUP),
    of=("dx", "dy", "dz"),
    widened=dict.fromkeys(NUISANCE, 5.0 / PER_METRE),
)


def _columns() -> list[FloatArray]:
    """Columns 3 and 4 are at 30 degrees, 5 is at right angles to all others, 6 is column 4 made
    faint.
    """
    random = np.random.default_rng(3)
    found = []
    for _ in range(4):
        raw = random.standard_normal((6, 25, 7))
        raw -= raw.mean(axis=0)
        flat, _ = np.linalg.qr(raw.reshape(-1, 7))
        flat = flat.reshape(raw.shape) * 10.0
        flat[..., 4] = np.cos(np.pi / 6) * flat[..., 3] + np.sin(np.pi / 6) * flat[..., 4]
        flat[..., 6] = 0.05 * flat[..., 4]
        flat[..., :3] *= PER_METRE
        found.append(flat)
    return found


COLUMNS = _columns()


@pytest.fixture(scope="module")
def blocks() -> list[Block]:
    return linear_blocks(COLUMNS, NUISANCE, KNOWN, {}, seed=1)


def test_mimicry_is_the_squared_cosine(blocks):
    assert mimicry(blocks, NUISANCE, KNOWN, TIME, LUMP) == pytest.approx(
        np.cos(np.pi / 6) ** 2, abs=0.02
    )
    assert mimicry(blocks, NUISANCE, KNOWN, LUMP, TIME) == pytest.approx(
        np.cos(np.pi / 6) ** 2, abs=0.02
    )
    assert mimicry(blocks, NUISANCE, KNOWN, WEIGHT, TIME) < 0.01
    assert mimicry(blocks, NUISANCE, KNOWN, OFFSET, WEIGHT) < 0.01


def test_what_a_rival_has_more_freedom_for_it_imitates_at_least_as_well(blocks):
    both = Candidate(
        start=OFFSET.start, of=OFFSET.of, widened={0: 5.0 / PER_METRE}, columns=(3,), spread=(1.0,)
    )
    assert (
        mimicry(blocks, NUISANCE, KNOWN, LUMP, both)
        >= mimicry(blocks, NUISANCE, KNOWN, LUMP, TIME) - 1e-12
    )
    assert mimicry(blocks, NUISANCE, KNOWN, TIME, TIME) == pytest.approx(1.0)


@pytest.mark.parametrize("candidate", [TIME, LUMP, WEIGHT, OFFSET], ids=lambda one: one.start.name)
def test_a_cause_at_its_limit_gains_the_bound_and_one_of_half_the_size_a_good_deal_less(candidate):
    """On data made of residuals: the mean over draws, which noise raises by no more than a few
    nats.
    """
    limit = detection_limits(
        linear_blocks(COLUMNS, NUISANCE, KNOWN, {}, 0), NUISANCE, KNOWN, candidate, BOUND
    )[0]
    column = [*candidate.widened, *candidate.columns][0]
    gains = []
    for size in (limit.size, limit.size / 2):
        rights = [
            right_sides(linear_blocks(COLUMNS, NUISANCE, KNOWN, {column: size}, seed))
            for seed in range(200)
        ]
        whole = linear_blocks(COLUMNS, NUISANCE, KNOWN, {}, 0)
        gains.append(
            float(linear_gains(whole, np.concatenate(rights), NUISANCE, KNOWN, [candidate]).mean())
        )
    assert gains[0] == pytest.approx(BOUND, abs=4.0)
    assert gains[1] < 0.5 * BOUND


def test_less_noise_sees_smaller_causes(blocks):
    quiet = [Block(block.name, 4.0 * block.gram, block.values) for block in blocks]
    for candidate in (TIME, WEIGHT):
        loud, soft = (
            detection_limits(data, NUISANCE, KNOWN, candidate, BOUND)[0].size
            for data in (blocks, quiet)
        )
        assert soft == pytest.approx(loud / 2, rel=0.05)


def test_what_moves_nothing_is_seen_at_no_size(blocks):
    still = [
        Block(
            block.name,
            np.where(np.arange(8) == 6, 0.0, block.gram) * (np.arange(8) != 6)[:, None],
            1.0,
        )
        for block in blocks
    ]
    limit = detection_limits(still, NUISANCE, KNOWN, WEIGHT, BOUND)[0]
    assert limit.size == np.inf and limit.to_json() == {"share": None}


def test_more_than_the_parameter_can_be_is_no_size(blocks):
    """A lump is at most 50 times as stiff: no factor beyond that is promised to be seen."""
    for loudness in (1.0, 1e2, 1e3, 1e6):
        loud = [Block(block.name, block.gram / loudness, block.values) for block in blocks]
        limit = detection_limits(loud, NUISANCE, KNOWN, LUMP, BOUND)[0]
        ratio = LUMP.start.numbers()[-1]
        assert limit.size == np.inf or limit.size <= ratio.coordinate(ratio.high)
        told = limit.to_json()["factor"]
        assert (
            told is None
            if limit.size == np.inf
            else told == pytest.approx(ratio.value(limit.size), rel=1e-2)
        )
    assert limit.size == np.inf


def test_map_takes_the_place_that_is_seen_best_and_says_what_half_of_them_reach(blocks):
    told = {
        one.effect: one
        for one in identifiability_of(
            blocks, NUISANCE, KNOWN, [TIME, FAR_LUMP, LUMP, WEIGHT, OFFSET], BOUND
        )
    }
    assert list(told) == ["time_offset", "stiff_inclusion", "gravity", "tool_offset"]
    lump = told["stiff_inclusion"]
    assert lump.candidate is LUMP and lump.typical.size > 5 * lump.limits[0].size
    assert max(lump.alike, key=lambda name: lump.alike[name]) == "time_offset"
    assert [limit.to_json()["parameter"] for limit in told["tool_offset"].limits] == [
        "dx",
        "dy",
        "dz",
    ]


def test_report_states_a_change_a_factor_or_a_share(blocks):
    rows = [
        one.to_json()
        for one in identifiability_of(blocks, NUISANCE, KNOWN, [TIME, LUMP, WEIGHT], BOUND)
    ]
    assert json.loads(json.dumps(rows)) == rows
    time, lump, weight = rows
    assert set(time["limits"][0]) == {"parameter", "unit", "change"} and time["at"] == {}
    assert lump["limits"][0]["factor"] > 1 and set(lump["at"]) == {"x", "y", "z", "radius"}
    assert set(weight["limits"][0]) == {"share"} and weight["at"] == {
        "specific_weight_over_stiffness": {"value": 1.5, "unit": "1/m"}
    }
    assert lump["alike"][0]["effect"] == "time_offset"
    assert [row["share"] for row in lump["alike"]] == sorted(
        (row["share"] for row in lump["alike"]), reverse=True
    )
