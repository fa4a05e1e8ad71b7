"""The specification of a sweep: validation, and JSON."""

from __future__ import annotations

from typing import Any

import pytest

from palpate.foundation.errors import SetupError
from palpate.sweep import Axis, ParameterSpace, SweepSpec

NU = Axis("poisson_ratio.nu", 0.3, 0.49)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "best"}, "grid, random"),
        ({"steps": 1}, "2 to 1000"),
        ({"method": "cmaes"}, "two parameters"),
        ({"frames": 0}, "frames"),
    ],
)
def test_invalid_specification_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(SetupError, match=message):
        SweepSpec(space=ParameterSpace((NU,)), **change)


def test_specification_survives_json() -> None:
    spec = SweepSpec(
        space=ParameterSpace((NU,), {"gravity.specific_weight_over_stiffness": 1.0}),
        method="tpe",
        points=7,
        sequences=("a",),
        seed=3,
    )
    assert SweepSpec.from_json(spec.to_json()) == spec
