"""The virtual block under a whole motion: each push on a mesh of its own, or all pushes on one mesh
where the material has a history.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush
from palpate.synthetic.bench.push_segments import solve_segments
from palpate.synthetic.bench.solved_track import SolvedPush, SolvedTrack
from palpate.synthetic.bench.specimen import Specimen
from palpate.synthetic.bench.true_body import base_seams, material_levels, true_offset, true_radius
from palpate.synthetic.laws.stiffness_fields import points_along
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.tet_block import IntArray, TetBlock, TetGrading, mesh_block
from palpate.synthetic.solver.tet_equilibrium import InstabilityError

__all__ = ["Mesher", "neutral_displacement", "rest_surface", "solve_motion"]

_AT_REST = 8e-3
"""Edge of the elements of an untouched body [m]."""
SHORTER, MOST_SHORT = 1.0e-3, 4.5e-3
"""Step by which a push into an unstable block is shortened, and the limit of it [m]."""

Mesher = Callable[[Scenario, Sequence[PlannedPush], float], TetBlock]
"""Meshes the body for some pushes of a scenario, with edges of the given length [m] at their
contacts."""


def solve_motion(
    scenario: Scenario,
    motion: MotionPlan,
    fine: float | None = None,
    body: Mesher | None = None,
    begun: tuple[float, float] = (0.0, 0.0),
) -> SolvedTrack:
    """Solve one motion of a scenario.

    Every push gets a mesh that is fine at its contact; a material with a history gets one mesh for
    all. Pressed against a hard lump, the block becomes unstable at some depth and jumps aside. Such
    a push is shortened; the motion of the result is the one that was carried out.

    Args:
        scenario: what is believed and hidden.
        motion: as planned.
        fine: longest element edge at the contact [m]; that of the scenario without it.
        body: meshes the body; a block without it.
        begun: slip of the base before (x, y) [m].
    """
    fine, body = fine or scenario.fine, body or _block
    ends = [*(float(push.times[0]) for push in motion.pushes[1:]), motion.duration]
    slip = np.array([*begun, 0.0])
    if scenario.has_history:
        solved_pushes = _solve_on_one_mesh(scenario, motion.pushes, ends, fine, body, slip)
    else:
        solved_pushes = _solve_separately(scenario, motion, ends, fine, body, slip)
    return SolvedTrack(
        replace(motion, pushes=tuple(solved.push for solved in solved_pushes)), tuple(solved_pushes)
    )


def _solve_separately(
    scenario: Scenario,
    motion: MotionPlan,
    ends: Sequence[float],
    fine: float,
    body: Mesher,
    slip: FloatArray,
) -> list[SolvedPush]:
    """Solve each push on a mesh of its own; only the slip of the base is passed on."""
    solved_pushes = []
    for push, end in zip(motion.pushes, ends, strict=True):
        solved, slip = _solve_push(scenario, push, motion.axis, slip, fine, end, body)
        solved_pushes.append(solved)
    return solved_pushes


def _solve_push(
    scenario: Scenario,
    push: PlannedPush,
    axis: FloatArray,
    slip: FloatArray,
    fine: float,
    end: float,
    body: Mesher,
) -> tuple[SolvedPush, FloatArray]:
    """Solve one push from a base that has slipped by `slip` (3,) [m], as deep as it is stable.

    Returns:
        the solved push and the slip (3,) [m] after it.
    """
    for short in np.arange(0.0, MOST_SHORT, SHORTER):
        tried = push.shallower(float(short))
        block = body(scenario, (tried,), fine)
        specimen = Specimen(scenario, block, slip, axis)
        try:
            creep = specimen.creep
            settled = specimen.settled + (creep * float(tried.times[0]) if creep.any() else slip)
            drawn = (
                block.surface_rest,
                block.surface_faces,
                settled,
                solve_segments(specimen, tried, end),
                (tried,),
                creep,
            )
            return SolvedPush(tried, *drawn), specimen.slip
        except InstabilityError as error:
            failure = error
        finally:
            specimen.close()
    raise failure


def _solve_on_one_mesh(
    scenario: Scenario,
    pushes: Sequence[PlannedPush],
    ends: Sequence[float],
    fine: float,
    body: Mesher,
    slip: FloatArray,
) -> list[SolvedPush]:
    """Solve all pushes on one mesh, which carries the material's history."""
    block = body(scenario, pushes, fine)
    specimen, solved_pushes = Specimen(scenario, block, slip), []
    try:
        for push, end in zip(pushes, ends, strict=True):
            settled, snapshot = specimen.surface, specimen.snapshot
            for short in np.arange(0.0, MOST_SHORT, SHORTER):
                tried = push.shallower(float(short))
                specimen.restore(snapshot)
                try:
                    segments = solve_segments(specimen, tried, end)
                    break
                except InstabilityError as error:
                    failure = error
            else:
                raise failure
            solved_pushes.append(
                SolvedPush(
                    tried, block.surface_rest, block.surface_faces, settled, segments, tuple(pushes)
                )
            )
    finally:
        specimen.close()
    return solved_pushes


def neutral_displacement(scenario: Scenario, solved: SolvedPush, centre: FloatArray) -> FloatArray:
    """Displacement (s, 3) [m] of the drawn surface without hidden effects, for a stated tool centre
    (3,) [m].

    Where the block has another size than believed, the displacement leads from the true rest shape
    to the believed block.
    """
    believed = replace(scenario, effects=())
    low, high = _bounds(believed)
    grading = _grading(
        scenario if scenario.true_size == scenario.size else believed, solved.meshed, scenario.fine
    )
    specimen = Specimen(believed, mesh_block(scenario.size, grading), np.zeros(3))
    try:
        outwards = centre - np.clip(centre, low, high)
        outwards = outwards / np.linalg.norm(outwards) if np.any(outwards) else solved.push.outwards
        surface = [
            specimen.solve_key_frame(centre + outwards * clear)
            for clear in np.arange(8e-3, -1e-9, -1.6e-3)
        ][-1].surface
        if scenario.true_size == scenario.size:
            return surface
        places = solved.rest * (np.array(scenario.size) / np.array(scenario.true_size))
        nearest = cKDTree(specimen.block.surface_rest).query(places)[1]
        return np.asarray(places + surface[nearest] - solved.rest)
    finally:
        specimen.close()


def rest_surface(
    scenario: Scenario, body: Mesher | None = None
) -> tuple[FloatArray, FloatArray, IntArray]:
    """The untouched body.

    Args:
        scenario: what is believed and hidden.
        body: meshes the body; a block without it.

    Returns:
        drawn surface of the true shape (s, 3) [m], its displacement (s, 3) [m], triangles (t, 3).
    """
    block = (body or _resting_block)(scenario, (), _AT_REST)
    specimen = Specimen(scenario, block, np.zeros(3))
    specimen.close()
    return block.surface_rest, specimen.settled, block.surface_faces


def _resting_block(scenario: Scenario, pushes: Sequence[PlannedPush], fine: float) -> TetBlock:
    levels = material_levels(scenario)
    grading = TetGrading(np.zeros((1, 3)), np.zeros(1), np.full(1, fine), fine, 0.5, levels)
    return mesh_block(scenario.true_size, grading)


def _block(scenario: Scenario, pushes: Sequence[PlannedPush], fine: float) -> TetBlock:
    return mesh_block(scenario.true_size, _grading(scenario, pushes, fine))


def _bounds(scenario: Scenario) -> tuple[FloatArray, FloatArray]:
    x, y, z = scenario.true_size
    return np.array([-x / 2, -y / 2, 0.0]), np.array([x / 2, y / 2, z])


def _grading(scenario: Scenario, pushes: Sequence[PlannedPush], fine: float) -> TetGrading:
    """Refine at the first contact of each push and along a drag; a lump gets elements smaller than
    its radius, and a tube no larger ones.
    """
    parts = [_touched(scenario, push, fine) for push in pushes]
    points, reach, edges = (np.concatenate([part[number] for part in parts]) for number in range(3))
    lump = scenario.hidden("stiff_inclusion")
    if lump is not None:
        points = np.concatenate([points, [[lump.value(axis) for axis in "xyz"]]])
        reach = np.append(reach, lump.value("radius"))
        edges = np.append(edges, max(fine, 0.7 * lump.value("radius")))
    tube = scenario.hidden("stiff_tube")
    if tube is not None:
        low, high = _bounds(scenario)
        axis = points_along(tube, low, high)
        points = np.concatenate([points, axis])
        reach = np.append(reach, np.full(len(axis), tube.value("radius")))
        edges = np.append(edges, np.full(len(axis), max(fine, tube.value("radius"))))
    return TetGrading(
        points, reach, edges, levels=material_levels(scenario), seams=base_seams(scenario)
    )


def _touched(
    scenario: Scenario, push: PlannedPush, fine: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Contact points (n, 3), radius of refinement around them (n,) and edge length (n,) [m]."""
    low, high = _bounds(scenario)
    radius = true_radius(scenario)
    way = push.place(np.arange(0.0, push.corners[-1] + 1e-3, 1.0e-3))
    way = way + true_offset(scenario, way)
    touching = way[np.linalg.norm(way - np.clip(way, low, high), axis=1) < radius]
    touching = touching if len(touching) else way[-1:]
    shallow = (
        touching[:1]
        if len(push.waypoints) == 2
        else touching[touching[:, 2] < touching[:, 2].min() + 1e-4]
    )
    points = _on_surface(shallow, low, high)
    if scenario.disturbance("shaft_contact") is not None and abs(push.outwards[2]) < 0.5:
        points = np.concatenate([points, np.clip([[*way[-1][:2], high[2]]], low, high)])
        return points, np.full(2, 0.8 * radius), np.array([fine, 1.2 * fine])
    reach = np.full(len(points), (0.8 if len(points) == 1 else 0.5) * radius)
    return points, reach, np.full(len(points), fine if len(points) == 1 else 1.2 * fine)


def _on_surface(centres: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The nearest points (n, 3) [m] of the block's faces to tool centres (n, 3) [m]."""
    points = np.clip(centres, low, high)
    inside = np.all((centres > low) & (centres < high), axis=1)
    points[inside, 2] = high[2]
    return points
