from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from core.batch import replay_batch
from core.batch.member import Member
from core.batch.membership import obstacle
from core.batch.path import lead
from core.errors import Cancelled, SetupError
from core.fem.newton import Outcome
from core.frames import FloatArray
from core.mesh import GridSpec
from core.replay import Equilibrium, replay
from core.setup import Box, Detachment, Fibres, Inclusion, Layer, Load, Material, Setup, Support, Tool
from core.sweep import sweep

SIZE = (0.0687, 0.0393, 0.0358)
TOP = SIZE[2] + 5e-3
STATED = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
LUMP = Inclusion(x=0.01, y=0.0, z=0.025, radius=8e-3, stiffness_ratio=10.0)
SETUPS = [
    STATED,
    replace(STATED, material=Material(poisson_ratio=0.48, stretch_limit=10.0, young_modulus=2e4)),
    replace(STATED, tool=Tool(radius=4.5e-3, offset=(1e-3, -5e-4, 0.0))),
    replace(STATED, load=Load(specific_weight_over_stiffness=2.0)),
    replace(STATED, material=Material(inclusions=(LUMP,), fibres=Fibres(direction=0.3, stiffness_ratio=3.0))),
    replace(STATED, material=Material(layer=Layer(thickness=3e-3, stiffness_ratio=3.0), log_ratio=0.7)),
]
SMALL = GridSpec(nodes=(7, 5, 5))
GRIDS = {
    "even": GridSpec(nodes=(13, 5, 5)),
    "graded": GridSpec(nodes=(9, 7, 7), spacing=2e-3),
    "quadratic": GridSpec(nodes=(13, 5, 5), order=2),
    "graded quadratic": GridSpec(nodes=(7, 7, 5), spacing=2e-3, order=2),
}
POKE = np.array([(8e-3, 4e-3, TOP - depth) for depth in (-3e-3, 5e-4, 1.5e-3, 2.5e-3, 4.5e-3, 2e-3, -3e-3)])
DRAG = np.array([(x, 2e-3, TOP - 2e-3) for x in (-4e-3, -3e-3, -2e-3, 2e-3)])


def _agree(found: list[Equilibrium], wanted: list[Equilibrium]) -> None:
    assert len(found) == len(wanted)
    for here, there in zip(found, wanted, strict=True):
        assert here.outcome is there.outcome and here.in_contact == there.in_contact
        assert here.probe.radius == there.probe.radius and np.array_equal(here.probe.centre, there.probe.centre)
        assert np.allclose(here.mesh.nodes, there.mesh.nodes, rtol=0, atol=1e-12)
        assert np.abs(here.displacement - there.displacement).max() < 2e-6
        assert np.linalg.norm(here.force - there.force) <= 1e-3 * np.linalg.norm(there.force)
        assert here.penetration == pytest.approx(there.penetration, abs=1e-6) and here.residual <= 1e-6


@pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS)
@pytest.mark.parametrize("way", [POKE, DRAG], ids=["poke", "drag"])
def test_batch_finds_what_single_replays_find(grid, way):
    found = replay_batch(SETUPS, way, grid)
    assert any(frame.in_contact for frame in found[0])
    for frames, setup in zip(found, SETUPS, strict=True):
        _agree(frames, replay(setup, way, grid))


@pytest.fixture
def together(monkeypatch: pytest.MonkeyPatch) -> None:
    """No frame may be solved by itself."""

    def never(*arguments: object) -> None:
        raise AssertionError("a frame was solved by itself")

    for name in ("lead", "solve"):
        monkeypatch.setattr(f"core.replay.{name}", never)


@pytest.mark.usefixtures("together")
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32], ids=str)
def test_all_frames_are_solved_together_in_either_precision(dtype):
    found = replay_batch(SETUPS, POKE, GRIDS["even"], dtype=dtype)
    assert all(frame.outcome is Outcome.CONVERGED and frame.residual <= 1e-6 for frames in found for frame in frames)
    assert sum(frame.in_contact for frames in found for frame in frames) > 4 * len(SETUPS)


def test_single_precision_tangents_change_no_answer():
    singles, doubles = replay_batch(SETUPS, POKE, SMALL, dtype=torch.float32), replay_batch(SETUPS, POKE, SMALL)
    for single, double in zip(singles, doubles, strict=True):
        _agree(single, double)
    assert not np.array_equal(singles[0][3].displacement, doubles[0][3].displacement)  # the tangents were others


def test_each_set_may_have_its_own_way():
    ways = np.stack([POKE, POKE + np.array([-5e-3, 0.0, 1e-3])])
    found = replay_batch([STATED, STATED], ways, SMALL)
    for frames, way in zip(found, ways, strict=True):
        _agree(frames, replay(STATED, way, SMALL))
    assert not np.allclose(found[0][3].displacement, found[1][3].displacement, atol=1e-4)


def test_set_without_equilibrium_is_told_and_spoils_no_other(monkeypatch):
    monkeypatch.setattr("core.fem.newton.MAX_SPLITS", 0)  # in vain here, and slow
    lost = replace(STATED, tool=Tool(radius=5e-3, offset=(0.0, 0.0, -0.022)))
    good, bad = replay_batch([STATED, lost], POKE[2:4], SMALL)
    _agree(good, replay(STATED, POKE[2:4], SMALL))
    assert [frame.outcome for frame in bad] == [frame.outcome for frame in replay(lost, POKE[2:4], SMALL)]
    assert any(frame.outcome is not Outcome.CONVERGED for frame in bad)


def test_frame_that_fails_in_the_batch_is_solved_by_itself(monkeypatch):
    def never(*arguments):
        balance = lead(*arguments)
        balance.balanced[1] = False
        return balance

    own, alone = Member.alone, []

    def counted(member: Member, centre: FloatArray) -> None:
        alone.append(member.setup)
        own(member, centre)

    monkeypatch.setattr("core.batch.replay.lead", never)
    monkeypatch.setattr(Member, "alone", counted)
    for frames, setup in zip(replay_batch(SETUPS[:3], POKE, SMALL), SETUPS, strict=False):
        _agree(frames, replay(setup, POKE, SMALL))
    assert alone.count(SETUPS[1]) == len(POKE) > alone.count(STATED)


@dataclass(frozen=True, kw_only=True)
class _SpinningTool(Tool):
    spin: float = 0.0


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({}, None),
        ({"material": Material(law="corotational")}, "material.law"),
        ({"element_size": 6e-3}, "element_size"),
        ({"support": Support(friction_coefficient=0.3)}, "support.friction_coefficient"),
        ({"support": Support(detached=(Detachment(edge="+x", extent=0.01),))}, "support.detached"),
        ({"support": Support(stiffness_over_E=200.0)}, "support.stiffness_over_E"),
        ({"tool": Tool(radius=5e-3, compliance_times_stiffness=2.0)}, "tool.compliance_times_stiffness"),
        ({"tool": Tool(radius=5e-3, friction_coefficient=0.3)}, "tool.friction_coefficient"),
        ({"tool": _SpinningTool(radius=5e-3, spin=1.0)}, "tool.spin"),
        ({"tool": _SpinningTool(radius=5e-3)}, None),
    ],
)
def test_what_a_batch_cannot_hold_is_known_by_its_key(changes, key):
    assert obstacle(replace(STATED, **changes)) == key


def test_sets_that_no_batch_can_hold_are_replayed_by_themselves_in_their_place():
    detached = replace(STATED, support=Support(detached=(Detachment(edge="+x", extent=0.01),)))
    giving = replace(STATED, tool=Tool(radius=5e-3, compliance_times_stiffness=20.0))
    setups = [detached, SETUPS[1], giving, STATED]
    found = replay_batch(setups, POKE[:4], SMALL)
    for frames, setup in zip(found, setups, strict=True):
        _agree(frames, replay(setup, POKE[:4], SMALL))
    assert all(np.abs(found[place][3].displacement - found[3][3].displacement).max() > 1e-5 for place in range(3))


def test_batch_larger_than_the_memory_is_done_in_parts(monkeypatch):
    sizes: list[int] = []

    def counted(blocks, *rest):
        sizes.append(len(blocks.loads.least))
        return lead(blocks, *rest)

    monkeypatch.setattr("core.batch.replay.lead", counted)
    for frames, setup in zip(replay_batch(SETUPS[:3], POKE[:3], SMALL, memory=1.0), SETUPS, strict=False):
        _agree(frames, replay(setup, POKE[:3], SMALL))
    assert set(sizes) == {1}


def test_no_sets_give_no_frames():
    assert replay_batch([], POKE, SMALL) == []
    assert replay_batch([STATED], np.empty((0, 3)), SMALL) == [[]]


@pytest.mark.parametrize("device", ["tpu", "cuda:99", "cuda:x"])
def test_device_that_is_not_there_is_named_beside_those_that_are(device):
    with pytest.raises(SetupError, match=rf"no device '{device}' here; there is cpu") as caught:
        replay_batch([STATED], POKE, SMALL, device=device)
    assert caught.value.where == {"key": "device", "value": device}


def test_progress_grows_from_nothing_and_never_passes_one():
    told: list[float] = []
    replay_batch(
        [STATED, replace(STATED, support=Support(friction_coefficient=0.5))], POKE[:3], SMALL, report=lambda at, _: told.append(at)
    )
    assert told[0] == 0.0 and told == sorted(told) and len(set(told)) == 6 and told[-1] < 1.0


def test_cancelling_ends_the_batch():
    def stop(fraction: float, text: str) -> None:
        if fraction > 0.3:
            raise Cancelled(text)

    with pytest.raises(Cancelled, match="frame 4 of 7, 2 sets"):
        replay_batch(SETUPS[:2], POKE, SMALL, report=stop)


def test_sweep_takes_single_replays_on_a_processor_and_a_batch_elsewhere(monkeypatch):
    for frames, setup in zip(sweep(SETUPS[:2], POKE[:3], SMALL), SETUPS, strict=False):
        _agree(frames, replay(setup, POKE[:3], SMALL))
    asked: list[str] = []
    monkeypatch.setattr("core.batch.replay_batch", lambda setups, centres, grid, **rest: asked.append(rest["device"]))
    sweep([STATED], POKE, SMALL, device="cuda")
    assert asked == ["cuda"]


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA here")
@pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS)
def test_graphics_card_finds_what_a_processor_finds(grid):
    found = replay_batch(SETUPS, POKE, grid, device="cuda")
    assert any(frame.in_contact for frame in found[0])
    for frames, setup in zip(found, SETUPS, strict=True):
        _agree(frames, replay(setup, POKE, grid))
