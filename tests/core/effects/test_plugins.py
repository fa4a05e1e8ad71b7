"""The example of core/effects/README.md, installed as a package of its own, and packages that are
off.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, Self

import pytest

import palpate.effects
from palpate.effects import (
    CATALOGUE,
    DIAGNOSED,
    OUTSIDE,
    Effect,
    Linearisation,
    NuisanceBlock,
    Slot,
    parameter,
)
from palpate.effects.plugins import GROUP, checked, outside_effects
from palpate.foundation.errors import EffectError
from palpate.setup.setup import Setup

README = Path(palpate.effects.__file__).with_name("README.md")
USE = """
import json, warnings
warnings.simplefilter("error")
import numpy as np
from palpate.effects import (
    CATALOGUE, DIAGNOSED, OUTSIDE, Linearisation, effect_named, from_json
)
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Setup, Tool

setup = Setup(geometry=Box(size=(0.0687, 0.0393, 0.0358)), tool=Tool(radius=5e-3))
vessel = effect_named("vessel")
assert OUTSIDE == (vessel,) and vessel in CATALOGUE and vessel in DIAGNOSED
assert vessel.linearisation is Linearisation.TANGENT and len(vessel.tangents(setup)) == 2
start = vessel.starts(setup)[0]
assert from_json(json.loads(json.dumps(start.to_json()))) == start
grid, way = GridSpec(nodes=(9, 7, 6), spacing=2e-3), np.array([[0.0, -4e-3, 0.0358 + 5e-3 - 4e-3]])
plain, neutral, found = (
    replay(one, way, grid)[0].displacement
    for one in (setup, vessel.neutral(setup).apply(setup), start.apply(setup))
)
print(json.dumps([float(np.abs(neutral - plain).max()), float(np.abs(found - plain).max())]))
"""


def _blocks(language: str) -> str:
    return "\n".join(re.findall(rf"```{language}\n(.*?)```", README.read_text(), flags=re.DOTALL))


def _install(folder: Path) -> None:
    """As a package manager leaves it: the module, and beside it what says that it is there."""
    (folder / "my_effects.py").write_text(_blocks("python"))
    points = re.search(r'entry-points\."(.+?)"\]\n(\w+) = "(.+?)"', _blocks("toml"))
    assert points is not None
    info = folder / "my_effects-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-effects\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[{}]\n{} = {}\n".format(*points.groups()))


def test_the_readmes_example_joins_the_catalogue_once_it_is_installed(tmp_path):
    _install(tmp_path)
    root = str(Path(palpate.effects.__file__).parents[2])
    paths = os.pathsep.join([str(tmp_path), root, os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": paths}
    done = subprocess.run(
        [sys.executable, "-c", USE],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    neutral, found = json.loads(done.stdout)
    assert neutral < 1e-9 and found > 1e-4


def test_nothing_installed_is_nothing_added():
    assert OUTSIDE == () and set(DIAGNOSED) < set(CATALOGUE)


@dataclass(frozen=True, kw_only=True)
class Fine(Effect):
    """Keeps everything."""

    name, enters = "fine", Slot.MATERIAL
    summary = "all is well"
    size: float = parameter("m", low=0.0, high=1.0, scale=0.1)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(size=0.0)

    @classmethod
    def starts(cls, setup: Setup) -> list[Self]:
        return [cls(size=0.5)]

    def apply(self, setup: Setup) -> Setup:
        return setup


class Unfinished(Effect):
    name, enters, summary = "unfinished", Slot.TOOL, "apply is missing"


def _with(**changes: object) -> type[Effect]:
    return type("Odd", (Fine,), changes)


def _sized(**field: Any) -> type[Effect]:
    bounds: dict[str, Any] = {"low": 0.0, "high": 1.0, "scale": 0.1, **field}
    unit = str(bounds.pop("unit", "m"))
    body = {
        "__annotations__": {"size": "float"},
        "size": parameter(unit, **bounds),
        "__module__": __name__,
    }
    return dataclass(frozen=True, kw_only=True)(type("Odd", (Fine,), body))


WRONG = {
    "no class": (3, "no subclass"),
    "another class": (dict, "no subclass"),
    "unfinished": (Unfinished, "lacks apply, neutral, starts"),
    "no name": (_with(name=""), "no name"),
    "no slot": (_with(enters="material"), "no enters"),
    "a name that is taken": (_with(name="gravity"), "'gravity' is taken"),
    "geometry": (_with(enters=Slot.GEOMETRY), "geometry"),
    "no unit": (_sized(unit=""), "size has no unit"),
    "no bounds": (_sized(high=float("inf")), "bounded by 0 and inf"),
    "turned bounds": (_sized(low=2.0), "bounded by 2 and 1"),
    "logarithm of zero": (_sized(log=True), "may be 0"),
    "contrast of what is no ratio": (_sized(contrast=True, low=-0.5), "contrast and may be -0.5"),
    "logarithm and contrast": (
        _sized(contrast=True, log=True, low=0.5),
        "contrast by its logarithm, too",
    ),
    "logarithm that comes round": (_sized(periodic=True, log=True, low=0.5), "comes round"),
    "no linearisation": (_with(linearisation="tangent"), "no linearisation"),
    "strange amplitude": (_with(amplitude="weight"), "'weight' is no number of it"),
    "nuisance of a tangent": (
        _with(linearisation=Linearisation.TANGENT, nuisance=NuisanceBlock.TOOL_RADIUS),
        "go together",
    ),
    "nuisance of other numbers": (
        _with(linearisation=Linearisation.NUISANCE, nuisance=NuisanceBlock.CAMERA_POSE),
        "has 1 numbers, and the nuisance camera pose has 6",
    ),
    "local stiffness of nothing": (
        _with(linearisation=Linearisation.LOCAL_STIFFNESS),
        "no amplitude, which LOCAL_STIFFNESS needs",
    ),
    "no scale": (_sized(scale=0.0), "scale of size is 0"),
}


@pytest.mark.parametrize(("effect", "words"), WRONG.values(), ids=WRONG)
def test_what_breaks_the_contract_is_told_in_words(effect, words):
    with pytest.raises(EffectError, match=re.escape(words)):
        checked(effect, {"gravity"})


def test_what_keeps_the_contract_is_taken_and_a_broken_package_is_left_out_with_a_warning():
    points = [
        EntryPoint("one", f"{__name__}:Fine", GROUP),
        EntryPoint("three", "no_such_module:Effect", GROUP),
        EntryPoint("two", f"{__name__}:Fine", GROUP),
    ]
    with pytest.warns(UserWarning) as told:
        assert outside_effects({"gravity"}, points) == (Fine,)
    texts = [str(item.message) for item in told]
    assert any(
        "three = no_such_module:Effect is left out: ModuleNotFoundError" in text for text in texts
    )
    assert any("two" in text and "'fine' is taken already" in text for text in texts)
