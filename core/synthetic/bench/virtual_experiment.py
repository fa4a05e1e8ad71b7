"""The virtual block under a whole motion: probe by probe, each on a grid of its own, or all on one
where the block remembers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.motion_plan import Motion, Probe
from palpate.synthetic.bench.solved_track import Stretch, Track
from palpate.synthetic.bench.specimen import Specimen
from palpate.synthetic.bench.true_body import levels_of, seams_of, true_offset, true_radius
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.tet_block import Block, Grading, IntArray, mesh_block
from palpate.synthetic.solver.tet_equilibrium import GivesWay

__all__ = ["neutral_displacement", "perform", "rest_surface"]

SHORTER, MOST_SHORT = 1.0e-3, 4.5e-3


Mesher = Callable[[Scenario, Probe, float], Block]
"""A body for one probe of a scenario, fine where it touches."""


def perform(
    scenario: Scenario,
    motion: Motion,
    fine: float | None = None,
    body: Mesher | None = None,
    begun: tuple[float, float] = (0.0, 0.0),
) -> Track:
    """Solve one motion of a scenario; every probe gets a grid that is fine where it touches, a
    block that remembers one for all.

    Without a `body` it is the block's; one that remembers is always that. `begun` says how far the
    base had slid before [m].

    Pressed against a hard lump, the block gives way at some depth: it jumps aside, and the tool
    leads to no equilibrium any more. The operator stops such a push short of it; the track's motion
    is the one that was carried out.
    """
    fine = fine or scenario.fine
    ends = [*(float(probe.times[0]) for probe in motion.probes[1:]), motion.duration]
    slip = np.array([*begun, 0.0])
    if scenario.remembers:
        stretches = _lasting(scenario, motion.probes, ends, fine, slip)
    else:
        stretches = _apart(scenario, motion, ends, fine, body or _block, slip)
    return Track(
        replace(motion, probes=tuple(stretch.probe for stretch in stretches)), tuple(stretches)
    )


def _apart(
    scenario: Scenario,
    motion: Motion,
    ends: Sequence[float],
    fine: float,
    body: Mesher,
    slip: FloatArray,
) -> list[Stretch]:
    """Each probe on a grid of its own: of those before only the base's slip is left."""
    stretches = []
    for probe, end in zip(motion.probes, ends, strict=True):
        stretch, slip = _as_deep_as_it_goes(scenario, probe, motion.axis, slip, fine, end, body)
        stretches.append(stretch)
    return stretches


def _as_deep_as_it_goes(
    scenario: Scenario,
    probe: Probe,
    axis: FloatArray,
    slip: FloatArray,
    fine: float,
    end: float,
    body: Mesher,
) -> tuple[Stretch, FloatArray]:
    """One probe from a base that has slipped by `slip` (3,) [m], and the slip after it."""
    for short in np.arange(0.0, MOST_SHORT, SHORTER):
        tried = probe.shallower(float(short))
        block = body(scenario, tried, fine)
        bench = Specimen(scenario, block, slip, axis)
        try:
            creep = bench.creep
            settled = bench.settled + (creep * float(tried.times[0]) if creep.any() else slip)
            drawn = (
                block.surface_rest,
                block.surface_faces,
                settled,
                bench.passages(tried, end),
                (tried,),
                creep,
            )
            return Stretch(tried, *drawn), bench.slip
        except GivesWay as error:
            failure = error
        finally:
            bench.close()
    raise failure


def _lasting(
    scenario: Scenario,
    probes: Sequence[Probe],
    ends: Sequence[float],
    fine: float,
    slip: FloatArray,
) -> list[Stretch]:
    """All probes on one grid, on which the block remembers."""
    block = mesh_block(scenario.true_size, _grading(scenario, probes, fine))
    bench, stretches = Specimen(scenario, block, slip), []
    try:
        for probe, end in zip(probes, ends, strict=True):
            settled, standing = bench.surface, bench.standing
            for short in np.arange(0.0, MOST_SHORT, SHORTER):
                tried = probe.shallower(float(short))
                bench.resume(standing)
                try:
                    passages = bench.passages(tried, end)
                    break
                except GivesWay as error:
                    failure = error
            else:
                raise failure
            stretches.append(
                Stretch(
                    tried, block.surface_rest, block.surface_faces, settled, passages, tuple(probes)
                )
            )
    finally:
        bench.close()
    return stretches


def neutral_displacement(scenario: Scenario, stretch: Stretch, centre: FloatArray) -> FloatArray:
    """Displacement (s, 3) [m] of the drawn surface of `stretch` with no hidden effect and the
    tool's stated centre (3,) [m].

    Where the block has another size than believed, it is from the true rest shape to where the
    believed block would have been.
    """
    believed = replace(scenario, effects=())
    low, high = _bounds(believed)
    grading = _grading(
        scenario if scenario.true_size == scenario.size else believed, stretch.meshed, scenario.fine
    )
    bench = Specimen(believed, mesh_block(scenario.size, grading), np.zeros(3))
    try:
        outwards = centre - np.clip(centre, low, high)
        outwards = (
            outwards / np.linalg.norm(outwards) if np.any(outwards) else stretch.probe.outwards
        )
        surface = [
            bench.moment(centre + outwards * clear) for clear in np.arange(8e-3, -1e-9, -1.6e-3)
        ][-1].surface
        if scenario.true_size == scenario.size:
            return surface
        places = stretch.rest * (np.array(scenario.size) / np.array(scenario.true_size))
        nearest = cKDTree(bench.block.surface_rest).query(places)[1]
        return np.asarray(places + surface[nearest] - stretch.rest)
    finally:
        bench.close()


def rest_surface(scenario: Scenario) -> tuple[FloatArray, FloatArray, IntArray]:
    """The untouched block: drawn surface of the true shape (s, 3), its displacement (s, 3) [m], and
    triangles (t, 3).
    """
    grading = Grading(
        np.zeros((1, 3)), np.zeros(1), np.full(1, 8e-3), 8e-3, 0.5, levels_of(scenario)
    )
    block = mesh_block(scenario.true_size, grading)
    bench = Specimen(scenario, block, np.zeros(3))
    bench.close()
    return block.surface_rest, bench.settled, block.surface_faces


def _block(scenario: Scenario, probe: Probe, fine: float) -> Block:
    return mesh_block(scenario.true_size, _grading(scenario, (probe,), fine))


def _bounds(scenario: Scenario) -> tuple[FloatArray, FloatArray]:
    x, y, z = scenario.true_size
    return np.array([-x / 2, -y / 2, 0.0]), np.array([x / 2, y / 2, z])


def _grading(scenario: Scenario, probes: Sequence[Probe], fine: float) -> Grading:
    """Fine where each of the probes first touches, and along a drag; a lump gets elements smaller
    than its radius.
    """
    parts = [_touched(scenario, probe, fine) for probe in probes]
    points, reach, edges = (np.concatenate([part[number] for part in parts]) for number in range(3))
    lump = scenario.hidden("stiff_inclusion")
    if lump is not None:
        points = np.concatenate([points, [[lump.value(axis) for axis in "xyz"]]])
        reach = np.append(reach, lump.value("radius"))
        edges = np.append(edges, max(fine, 0.7 * lump.value("radius")))
    return Grading(points, reach, edges, levels=levels_of(scenario), seams=seams_of(scenario))


def _touched(
    scenario: Scenario, probe: Probe, fine: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (n, 3) where a probe touches, how far the grid is fine around them (n,), and how fine
    (n,), all in [m].
    """
    low, high = _bounds(scenario)
    radius = true_radius(scenario)
    way = probe.place(np.arange(0.0, probe.corners[-1] + 1e-3, 1.0e-3)) + true_offset(scenario)
    touching = way[np.linalg.norm(way - np.clip(way, low, high), axis=1) < radius]
    touching = touching if len(touching) else way[-1:]
    shallow = (
        touching[:1]
        if len(probe.waypoints) == 2
        else touching[touching[:, 2] < touching[:, 2].min() + 1e-4]
    )
    points = _on_surface(shallow, low, high)
    if scenario.disturbance("shaft_contact") is not None and abs(probe.outwards[2]) < 0.5:
        points = np.concatenate([points, np.clip([[*way[-1][:2], high[2]]], low, high)])
        return points, np.full(2, 0.8 * radius), np.array([fine, 1.2 * fine])
    reach = np.full(len(points), (0.8 if len(points) == 1 else 0.5) * radius)
    return points, reach, np.full(len(points), fine if len(points) == 1 else 1.2 * fine)


def _on_surface(centres: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The points (n, 3) of the block's faces next to tool centres (n, 3), inside or outside [m]."""
    points = np.clip(centres, low, high)
    inside = np.all((centres > low) & (centres < high), axis=1)
    points[inside, 2] = high[2]
    return points
