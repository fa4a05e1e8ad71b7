"""The blind suite: datasets with hidden effects, or none, are diagnosed without them, and scored.

`cases` draws what is hidden, `run_suite` makes and diagnoses each case in a process of its own,
`case_results` holds the result of one case, and `summary` sums the results up: rates, parameter
errors, coverage and calibration, against the targets.
"""

from palpate.blind.case_results import RESULTS_FILE, CaseResult, read_results
from palpate.blind.case_scenarios import drawn_of, scenario_of
from palpate.blind.cases import (
    KINDS,
    MIX,
    SHAPED,
    Case,
    all_cases,
    draw_cases,
    with_nuisances,
    with_shapes,
)
from palpate.blind.run_suite import known_results, run_case, run_suite
from palpate.blind.summary import summary_of

__all__ = [
    "KINDS",
    "MIX",
    "RESULTS_FILE",
    "SHAPED",
    "Case",
    "CaseResult",
    "all_cases",
    "draw_cases",
    "drawn_of",
    "known_results",
    "read_results",
    "run_case",
    "run_suite",
    "scenario_of",
    "summary_of",
    "with_nuisances",
    "with_shapes",
]
