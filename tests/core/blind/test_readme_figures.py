"""The README's figures of the blind suite agree with its stored rows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from palpate.blind import read_results, summary_of

ROOT = Path(__file__).parents[3]
SEED = 1400


@pytest.fixture(scope="module")
def readme() -> str:
    return re.sub(r"\s+", " ", (ROOT / "README.md").read_text())


def test_readme_has_the_figures_of_the_rows(readme: str) -> None:
    rows = read_results(ROOT / "benchmarks" / "blind" / f"suite-{SEED}.jsonl")
    reached = {target["key"]: target["reached"] for target in summary_of(rows, SEED)["targets"]}
    assert f"Of its {len(rows)} cases with seed {SEED}" in readme
    for key in ("clear.first", "limit_clear.first", "subtle.first", "pair.exact"):
        found = reached[key]
        share = f"{100 * found['low']:.0f} to {100 * found['high']:.0f} %"
        assert f"in {found['hits']} of {found['n']} ({share})" in readme, key
    nothing, outside, held = reached["control.named"], reached["outside.right"], reached["coverage"]
    assert f"nothing is named in {nothing['n'] - nothing['hits']} of {nothing['n']} " in readme
    assert f"{outside['hits']} of {outside['n']} causes outside the catalogue" in readme
    assert f"hold the truth in {held['hits']} of {held['n']}," in readme
    assert f"probabilities are {100 * reached['calibration']['value']:.1f} % off" in readme
    assert f"removes {100 * reached['removed']['value']:.0f} % of the reducible error" in readme
