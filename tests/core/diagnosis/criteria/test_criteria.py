"""Every threshold has unit, meaning and source, and a changed one changes the version."""

from __future__ import annotations

import ast
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import pytest

from palpate import diagnosis
from palpate.diagnosis.criteria import CRITERIA, criteria_rows

FOLDER = Path(diagnosis.__file__).parent
LAYOUT = {"TOOL_COLUMNS"}
"""Numbers that are no thresholds: how many columns of the Jacobian come first."""


def test_every_threshold_has_unit_meaning_and_source() -> None:
    rows = list(criteria_rows())
    assert len({row.name for row in rows}) == len(rows) > 150
    for row in rows:
        assert row.value and row.unit and row.meaning.endswith("."), row.name
        assert row.source == "chosen, not derived" or row.source.startswith(
            ("measured: ", "derived: ", "reference: ")
        ), row.name


def test_values_of_a_row_are_those_of_the_criteria() -> None:
    rows = {row.name: row for row in criteria_rows()}
    assert rows["naming.least_gain"].value == "25" and rows["naming.least_gain"].unit == "nat"
    assert rows["grouping.recovery_times"].value == "0.5, 1.5, 5"


def test_version_follows_every_value() -> None:
    versions = {CRITERIA.version, replace(CRITERIA).version}
    assert len(versions) == 1
    for topic in fields(CRITERIA):
        group = getattr(CRITERIA, topic.name)
        name = fields(group)[0].name
        value = getattr(group, name)
        other = value[:-1] if isinstance(value, tuple) else 2 * value
        versions.add(replace(CRITERIA, **{topic.name: replace(group, **{name: other})}).version)
    assert len(versions) == 1 + len(fields(CRITERIA))


def test_criteria_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        CRITERIA.naming.least_gain = 1.0  # type: ignore[misc]


def _numbers(tree: ast.Module) -> list[str]:
    """Names of a module's constants that are given as numbers."""
    found = []
    for node in tree.body:
        value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
        numbers = [
            one
            for one in ast.walk(value or ast.Tuple(elts=[]))
            if isinstance(one, ast.Constant) and type(one.value) in (int, float)
        ]
        if numbers and isinstance(value, ast.Constant | ast.Tuple | ast.UnaryOp):
            found.append(ast.unparse(node).partition(" =")[0])
    return found


@pytest.mark.parametrize("path", sorted(FOLDER.rglob("*.py")), ids=lambda path: path.stem)
def test_no_module_of_the_diagnosis_has_thresholds_of_its_own(path: Path) -> None:
    if path.parent.name != "criteria":
        assert set(_numbers(ast.parse(path.read_text(encoding="utf-8")))) <= LAYOUT
