"""Broken surfaces and poses give one error with file, value, bound and what to do."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from broken_shapes import SHAPE_BREAKAGES, write_shape
from shapes import box_surface

from palpate.dataset import open_dataset
from palpate.dataset.check import check_dataset
from palpate.foundation.errors import DatasetError
from palpate.foundation.frames import Transform
from palpate.setup.surface_repair.repair_surface import load_surface, repair
from palpate.setup.surface_repair.surface_summary import summarize

_TODO = re.compile(
    r"export it|add it|remove|correct|name |rename|close it|repair|flip|make the normals|keep one"
    r"|move|expected (one of|a 4x4|a plain|this file)|write|decimate|copy|plain file"
)


def test_the_dataset_is_whole_before_it_is_broken(tmp_path: Path) -> None:
    opened = open_dataset(write_shape(tmp_path / "shape"))
    assert not any("landmarks" in text for text in check_dataset(opened, Transform()).warnings)


@pytest.mark.parametrize("name", SHAPE_BREAKAGES)
def test_broken_shape_gives_one_error_that_names_place_and_expectation(
    name: str, tmp_path: Path
) -> None:
    folder = write_shape(tmp_path / "shape")
    breakage = SHAPE_BREAKAGES[name]
    breakage(folder)
    with pytest.raises(DatasetError) as caught:
        open_dataset(folder).validate()
    message = caught.value.message
    assert caught.value.where["file"] == breakage.where["file"], message
    assert message.startswith(str(breakage.where["file"])), message
    for words in breakage.says:
        assert words in message
    assert _TODO.search(message), message
    assert message.count("\n") == 0


def test_commands_that_messages_name_are_options_of_the_verb() -> None:
    import inspect

    from palpate.app.commands.surface import surface

    known = {f"--{name.replace('_', '-')}" for name in inspect.signature(surface).parameters}
    named = {
        option
        for breakage in SHAPE_BREAKAGES.values()
        for word in breakage.says
        for option in re.findall(r"--[a-z-]+", word)
    }
    assert len(named) >= 6
    assert {option for option in named if not any(o.startswith(option) for o in known)} == set()


def test_landmark_far_from_the_surface_is_told(tmp_path: Path) -> None:
    folder = write_shape(tmp_path / "shape")
    text = (folder / "dataset.toml").read_text()
    (folder / "dataset.toml").write_text(text.replace("mark_1 = [0.03,", "mark_1 = [0.09,"))
    told = check_dataset(open_dataset(folder), Transform()).warnings
    (warning,) = [text for text in told if "landmarks" in text]
    assert "landmarks.mark_1 lies 60 mm from the phantom's surface, as 1 of 4" in warning


def test_slivers_are_no_fault_and_are_counted(tmp_path: Path) -> None:
    folder = write_shape(tmp_path / "shape")
    vertices, triangles = box_surface((0.06, 0.04, 0.03))
    a, b, c = triangles[0]
    inner = 0.4995 * (vertices[a] + vertices[b]) + 0.001 * vertices[c]
    count = len(vertices)
    thin = np.concatenate([triangles[1:], [(a, b, count), (b, c, count), (c, a, count)]])
    import trimesh

    body = trimesh.Trimesh(np.concatenate([vertices, [inner]]), thin, process=False)
    body.export(folder / "phantom.stl")
    assert open_dataset(folder).geometry.volume == pytest.approx(7.2e-5, rel=1e-4)
    surface, _ = load_surface(folder / "phantom.stl", "m")
    assert summarize(surface).slivers == 1
    assert repair(surface, [])[0] is surface
