"""The blind suite: datasets with something hidden in them, or nothing, diagnosed by a process that
is not told, and scored.

`cases` draws what is hidden, `running` makes and diagnoses it in processes of its own, `results` is
what one case gave, and `summary` sums the results up: rates, parameter errors, coverage and
calibration, against the targets.
"""

from palpate.blind.case_results import RESULTS_FILE, CaseResult, read_results
from palpate.blind.cases import KINDS, MIX, Case, all_cases, draw_cases, scenario_of
from palpate.blind.run_suite import known_results, run_case, run_suite
from palpate.blind.summary import summary_of

__all__ = [
    "KINDS",
    "MIX",
    "RESULTS_FILE",
    "Case",
    "CaseResult",
    "all_cases",
    "draw_cases",
    "known_results",
    "read_results",
    "run_case",
    "run_suite",
    "scenario_of",
    "summary_of",
]
