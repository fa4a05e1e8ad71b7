"""The spread that parameter intervals lack, from errors and stated deviations."""

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from benchmarks.parameter_accuracy import lacking_deviation, run


def test_a_missing_spread_is_found():
    random = np.random.default_rng(0)
    stated = random.uniform(0.5, 1.0, 4000)
    errors = random.normal(size=4000) * np.hypot(stated, 2.0)
    assert lacking_deviation(errors, stated) == pytest.approx(2.0, rel=0.05)


def test_nothing_is_missing_where_the_stated_spread_is_enough():
    random = np.random.default_rng(1)
    stated = np.full(500, 1.0)
    assert lacking_deviation(random.normal(size=500) * 0.6, stated) == 0.0


def test_the_table_has_the_coverage_of_a_stored_suite():
    console = Console(width=140, record=True, file=io.StringIO())
    run(console, [Path("benchmarks/blind/suite-1400.jsonl")])
    text = console.export_text()
    assert "base_compliance.stiffness_over_E" in text
    assert "90 % intervals in all: 90 % (85 to 93)" in text
