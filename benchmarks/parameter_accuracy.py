"""Coverage of parameter intervals in stored blind suites, and the spread that they lack.

    python -m benchmarks.parameter_accuracy FILE ...

For every parameter of a cause that was named correctly the table has the number of cases, the
coverage of 90 % intervals, the root mean square of the errors over their stated deviations, and the
most likely standard deviation that the stated ones lack. The last column is in the units of the
parameter's search coordinate, as `palpate.effects.Parameter.accuracy`, and would be added to the
accuracy that the rows were made with as independent errors are.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import norm

from palpate.blind.case_results import read_results
from palpate.blind.parameter_errors import (
    SCORED_LEVEL,
    ReportedParameter,
    coverage,
    reported_parameters,
)
from palpate.blind.proportions import IntervalEstimate
from palpate.foundation.arrays import FloatArray

__all__ = ["errors_and_deviations", "lacking_deviation", "run"]


def errors_and_deviations(reported: Sequence[ReportedParameter]) -> tuple[FloatArray, FloatArray]:
    """Return errors (n,) and stated standard deviations (n,) in search coordinates.

    Parameters without an interval, and those that are not searched, are left out.
    """
    errors, deviations = [], []
    for one in reported:
        if one.searched is None or one.low is None or one.high is None:
            continue
        low, value, high, true = (
            one.searched.coordinate(number)
            for number in (one.low, one.value, one.high, one.nearest)
        )
        errors.append(value - true)
        deviations.append((high - low) / (2 * float(norm.ppf(0.5 + one.level / 2))))
    return np.array(errors), np.array(deviations)


def lacking_deviation(errors: FloatArray, deviations: FloatArray) -> float:
    """Return the most likely standard deviation that, with the stated ones, gives such errors.

    Args:
        errors: (n,).
        deviations: (n,) stated ones, in the same unit.
    """
    tried = np.array([0.0, *np.geomspace(1e-3, 10.0, 200)]) * np.abs(errors).max()
    variance = deviations[:, None] ** 2 + tried**2
    likelihood = -0.5 * (np.log(variance) + errors[:, None] ** 2 / variance).sum(axis=0)
    return float(tried[np.argmax(likelihood)])


def run(console: Console, files: Sequence[Path]) -> None:
    """Print one table of all files, and the coverage in all."""
    reported = reported_parameters(row for file in files for row in read_results(file))
    table = Table(title=f"{len(reported)} parameters of correctly named causes")
    for name in ("parameter", "cases", "90 % cover", "error over deviation", "lacking"):
        table.add_column(name)
    for key in sorted({one.key for one in reported}):
        own = [one for one in reported if one.key == key]
        errors, deviations = errors_and_deviations(own)
        if len(errors):
            table.add_row(
                key,
                str(len(errors)),
                _percent(coverage(own, SCORED_LEVEL)),
                f"{np.sqrt(np.mean((errors / deviations) ** 2)):.2f}",
                f"{lacking_deviation(errors, deviations):.2g}",
            )
    console.print(table)
    console.print(f"90 % intervals in all: {_percent(coverage(reported, SCORED_LEVEL))}")


def _percent(share: IntervalEstimate) -> str:
    """Return a share with its interval."""
    if share.value is None or share.low is None or share.high is None:
        return "–"
    return f"{100 * share.value:.0f} % ({100 * share.low:.0f} to {100 * share.high:.0f})"


if __name__ == "__main__":
    run(Console(width=140), [Path(name) for name in sys.argv[1:]])
