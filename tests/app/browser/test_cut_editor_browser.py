"""The modules of the import panel that draw nothing, run in Chromium: the sequences while they are
cut, and single values of import.toml.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from browsing import NEEDS_CHROMIUM

pytestmark = NEEDS_CHROMIUM
LOOK = [
    {
        "name": "monday",
        "start": 100.0,
        "end": 160.0,
        "sequences": [
            {"name": "top-01", "start": 110.0, "end": 120.0, "kind": "top", "split": "train"},
            {"name": "top-02", "start": 125.0, "end": 130.0, "kind": "top", "split": "none"},
        ],
    }
]
RUN = """async ([look, steps]) => {
  const { createCutEditor, plain } = await import('/static/js/cut-editor.js');
  const editor = createCutEditor(look, null, () => undefined);
  for (const [name, ...values] of steps) editor[name](...values);
  return {
    sequences: plain(editor.sequences).map(({ name, start, end }) => [name, start, end]),
    changed: editor.changed, selected: editor.chosen()?.name ?? null,
    undo: editor.canUndo(), redo: editor.canRedo(),
    problems: editor.problems().map(({ field, text }) => [field, text]),
  };
}"""
FOUND = [["top-01", 110.0, 120.0], ["top-02", 125.0, 130.0]]


@pytest.fixture
def tab(browser: Any, client: httpx.Client) -> Iterator[Any]:
    """A bare document of the server, in which the page's modules can be imported."""
    with browser.new_context() as context:
        found = context.new_page()
        found.goto(f"{client.base_url}/static/icon.svg")
        yield found


@pytest.fixture
def run(tab: Any) -> Any:
    def after(*steps: list[Any]) -> dict[str, Any]:
        found: dict[str, Any] = tab.evaluate(RUN, [LOOK, list(steps)])
        return found

    return after


def test_sequences_never_overlap_nor_leave_the_recording(run: Any) -> None:
    assert run()["sequences"] == FOUND and not run()["changed"]
    wide = run(["resize", 1, "end", 128.0], ["resize", 1, "start", 50.0])["sequences"]
    assert wide[0] == ["top-01", 100.0, 125.0]
    assert run(["resize", 2, "start", 131.0])["sequences"][1] == ["top-02", 129.8, 130.0]
    added = run(["add", "monday", 122.0, 140.0])
    assert added["sequences"][1] == ["sequence-01", 122.0, 125.0]
    assert added["selected"] == "sequence-01"
    assert run(["add", "monday", 112.0, 114.0])["sequences"] == FOUND


def test_a_sequence_is_split_where_both_parts_are_long_enough(run: Any) -> None:
    parts = run(["split", 1, 114.0])
    assert parts["sequences"][0] == ["top-01", 110.0, 114.0]
    assert parts["sequences"][1] == ["top-03", 114.0, 120.0]
    assert run(["split", 1, 110.1])["sequences"] == FOUND


def test_a_drag_is_undone_as_one_and_redone(run: Any) -> None:
    drag = [["resize", 1, "end", time, True] for time in (119.0, 118.0, 117.0)]
    moved = run(*drag, ["release"])
    assert moved["sequences"][0][2] == 117.0 and moved["changed"]
    back = run(*drag, ["release"], ["undo"])
    assert back["sequences"] == FOUND and not back["undo"] and back["redo"]
    assert run(*drag, ["release"], ["undo"], ["redo"])["sequences"] == moved["sequences"]
    twice = run(*drag, ["release"], *drag[:1], ["undo"])
    assert twice["sequences"] == moved["sequences"]
    assert run(["remove", 1], ["revert"])["sequences"] == FOUND


def test_names_are_checked_field_by_field(run: Any) -> None:
    assert run(["alter", 1, {"name": "top-02"}])["problems"][0] == [
        "name",
        "Another sequence is called top-02.",
    ]
    assert run(["alter", 1, {"name": "-a b"}])["problems"][0][0] == "name"
    assert run(["alter", 1, {"name": "first.1"}])["problems"] == []


def test_values_of_import_toml_are_replaced_in_its_text(tab: Any) -> None:
    text = 'name = "a"\n\n[streams]\npose = "/[a]"\n\n[wrench]\nframe = ""\nsign = 1\n'
    found = tab.evaluate(
        """async text => {
      const { mappingValue, withValues } = await import('/static/js/import-mapping.js');
      const next = withValues(text, {'wrench.frame': '"tool"', 'pose.tool_tip': '[0.0, 0.0, 0.1]'});
      return [next, mappingValue(next, 'wrench', 'frame'), mappingValue(next, 'wrench', 'name'),
              mappingValue(next, 'streams', 'pose')];
    }""",
        text,
    )
    changed = text.replace('frame = ""', 'frame = "tool"')
    assert found[0] == changed + "\n[pose]\ntool_tip = [0.0, 0.0, 0.1]\n"
    assert found[1:] == ['"tool"', None, '"/[a]"']
