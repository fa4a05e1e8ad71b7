"""The short form of the blind suite: an effect that was drawn has to be named, and nothing where nothing is hidden.

How often that goes wrong is what the full suite counts; PALPATE_SEED draws another case than the one that has always been right.
"""

from __future__ import annotations

import os
from pathlib import Path

from app.blind_page import blind_page
from core.blind import draw_cases, run_suite, summary_of


def test_effect_that_was_drawn_is_named_and_nothing_where_nothing_is_hidden(tmp_path: Path) -> None:
    seed = int(os.environ.get("PALPATE_SEED", "15"))
    fresh = draw_cases(seed, 1, kinds=["clear"], short=True)
    control = draw_cases(11, 1, kinds=["control"], short=True)
    cases = [*fresh, *control]
    print(f"seed {seed}: {fresh}")  # noqa: T201 (what was drawn, should it fail)
    results = run_suite(tmp_path, cases, workers=2)
    found, nothing = results
    assert not found.error and not nothing.error, f"seed {seed}: {found.error}{nothing.error}"
    assert found.right, f"seed {seed}: {found.verdict}, {found.named} where {found.hidden} is hidden"
    assert (nothing.verdict, nothing.causes) == ("none", [])
    assert found.report["gain"]["noise_floor"] > 0 and found.probabilities[found.named[0]] > 0.5
    summary = summary_of(results, seed)
    assert [summary["kinds"][kind]["right"]["hits"] for kind in ("clear", "control")] == [1, 1]
    assert "2 of 2 cases right" in blind_page(summary, results)
    assert [path.name for path in tmp_path.iterdir()] == ["results.jsonl"]
