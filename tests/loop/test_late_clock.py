"""A clock so late that frames are grouped anew by it and searched again: the cause that takes the longest (a slow test)."""

from __future__ import annotations

import json

import pytest
from looping import LATE_CLOCK, Loop, looped

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Loop:
    return looped(tmp_path_factory.mktemp("late"), LATE_CLOCK)[0]


def test_late_clock_is_named_with_its_size(late: Loop) -> None:
    found = late.found
    assert found.right, f"{found.verdict}, {found.named} where {found.hidden} is hidden"
    hidden = found.hidden[0]["parameters"]["offset"]["value"]
    offset = late.report["causes"][0]["parameters"]["offset"]
    assert offset["value"] == pytest.approx(hidden, abs=0.02)
    assert offset["low"] < hidden < offset["high"]
    assert late.report["gain"]["reducible_removed"]["value"] > 0.5


def test_the_map_of_what_can_be_told_sees_the_hidden_clock(late: Loop) -> None:
    rows = {row["effect"]: row for row in json.loads((late.run / "report.json").read_text())["ambiguity_map"]}
    assert 0.5e-3 < rows["time_offset"]["limits"][0]["change"] < 0.05  # a third of what is hidden at most
