"""The loop, once for all its tests: another solver hides what was drawn, or nothing, and the blind
suite diagnoses it.

How often that goes wrong is what the full suite counts; PALPATE_SEED draws another case than the
one that has always been right.
"""

from __future__ import annotations

import os
from functools import partial

import pytest
from looping import LATE_CLOCK, Loop, run_looked_at

from palpate.blind import draw_cases, run_suite


@pytest.fixture(scope="session")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Loop:
    seed = int(os.environ.get("PALPATE_SEED", LATE_CLOCK))
    fresh = draw_cases(seed, 1, kinds=["clear"], short=True)
    control = draw_cases(11, 1, kinds=["control"], short=True)
    print(f"seed {seed}: {fresh}")  # noqa: T201 (what was drawn, should it fail)
    folder, kept = tmp_path_factory.mktemp("suite"), tmp_path_factory.mktemp("kept")
    found, nothing = run_suite(
        folder, [*fresh, *control], workers=2, run=partial(run_looked_at, kept=kept)
    )
    assert not found.error and not nothing.error, f"seed {seed}: {found.error}{nothing.error}"
    return Loop(seed, folder, found, nothing, kept / "runs" / found.name)
