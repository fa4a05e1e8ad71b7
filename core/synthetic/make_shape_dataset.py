"""Virtual datasets of a free form under a depth camera: its surface, clouds, forces, and the truth.

The body is drawn from a family of shapes, pushed along its normals where the camera sees it, and
solved by the virtual bench's own solver. All pushes but one of each sequence are over a hidden
lump or tube.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import EffectError, SetupError
from palpate.foundation.frames import Transform
from palpate.foundation.progress import Report, silent
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.atomic_write import write_atomically
from palpate.synthetic.bench.depth_camera import CameraScene, DepthCamera
from palpate.synthetic.bench.motion_plan import MotionPlan
from palpate.synthetic.bench.sequence_recording import SequenceJob
from palpate.synthetic.bench.true_body import true_radius
from palpate.synthetic.bench.virtual_experiment import rest_surface
from palpate.synthetic.bodies.cast_form import CastForm
from palpate.synthetic.bodies.organ_shape import write_surface
from palpate.synthetic.bodies.robot_relation import ROBOT_RELATIONS, Bench
from palpate.synthetic.bodies.shape_draws import (
    ON_SHAPES,
    QUICK_ON_SHAPES,
    draw_in_shape,
    point_above,
)
from palpate.synthetic.bodies.shape_families import FAMILIES, draw_shape
from palpate.synthetic.bodies.shape_mesher import ShapeMesher
from palpate.synthetic.bodies.shape_pushes import (
    is_upright,
    on_one_side,
    push_motion,
    reachable_places,
    spread_places,
)
from palpate.synthetic.dataset_writer import write_config, write_ply
from palpate.synthetic.laws.stiffness_fields import beyond_inclusion, beyond_tube
from palpate.synthetic.make_dataset import TOUCH_NOISE, draw_camera, draw_camera_shift, record_all
from palpate.synthetic.scenario.disturbance import OF_ANY_BODY, draw_disturbance
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.scenario.truth_file import Truth

__all__ = ["ON_SHAPES", "ShapeScenario", "draw_shape_scenario", "make_shape_dataset"]

_SEQUENCES = ("poke-top-01", "poke-top-02", "poke-top-03", "poke-side-01", "poke-side-02")
_PUSHES = 3
"""Pushes of a sequence."""
_FELT = 6e-3
"""Distance of a lump from a pushed place within which it is felt [m]."""
_POINTS = 4.5e5
"""Points in a cloud for each square metre of the body's free surface [1/m^2]."""
_MARKS = 6
"""Landmarks on the surface."""


@dataclass(frozen=True, kw_only=True)
class ShapeScenario:
    """A free form, and what is believed and hidden of it.

    Attributes:
        family: of the shape.
        seed: of its proportions.
        scenario: beliefs and hidden effects; its size is the shape's.
        robot: how robot and phantom are related, one of `ROBOT_RELATIONS`.
        table: whether the camera gets readings of the table.
        cast: RMS offset of the cast's free surface from the stated one [m], for which nothing is to
            be named; a hidden `geometry_local` states its own.
    """

    family: str
    seed: int
    scenario: Scenario
    robot: str = "touches"
    table: bool = True
    cast: float = 0.0

    @cached_property
    def stated(self) -> Shape:
        """The body as its file states it."""
        return draw_shape(self.family, self.seed)

    @cached_property
    def true(self) -> Shape:
        """The body on the bench."""
        return self.form.of(self.stated).scaled(self.factors)

    @property
    def form(self) -> CastForm:
        """The cast's own offset."""
        hidden = self.scenario.hidden("geometry_local")
        return CastForm(hidden.value("rms") if hidden else self.cast, self.seed)

    @property
    def factors(self) -> FloatArray:
        """True over stated lengths along x, y, z (3,) [1], before the cast's own offset."""
        return np.asarray(np.array(self.scenario.true_size) / np.array(self.scenario.size))

    def on_true(self, places: FloatArray) -> FloatArray:
        """Places (n, 3) [m] of the true surface that lie at places of the stated surface."""
        scaled = np.asarray(places * self.factors)
        if self.form.rms == 0.0:
            return scaled
        distance, normals = self.true.facing_free(scaled)
        return scaled - distance[:, None] * normals


def draw_shape_scenario(
    family: str,
    effects: int,
    seed: int,
    among: tuple[str, ...] = QUICK_ON_SHAPES,
    disturbances: tuple[str, ...] = (),
) -> ShapeScenario:
    """Draw a free form with clear hidden effects, or with disturbances outside the catalogue.

    Raises SetupError for an unknown family, EffectError for an effect or a disturbance that no
    shape can have.

    Args:
        family: of the shape.
        effects: number of different hidden effects.
        seed: of everything random.
        among: effects to draw from.
        disturbances: names, of `OF_ANY_BODY`.
    """
    if family not in FAMILIES:
        raise SetupError(
            f"there is no shape {family!r}; there are {', '.join(FAMILIES)}", key="family"
        )
    for kind, names, known in (("hide", among, ON_SHAPES), ("have", disturbances, OF_ANY_BODY)):
        if unknown := [name for name in names if name not in known]:
            raise EffectError(
                f"the virtual bench cannot {kind} {unknown[0]!r} in a shape; "
                f"it knows {', '.join(known)}",
                effect=unknown[0],
            )
    shape = draw_shape(family, seed)
    hidden = draw_in_shape(shape, effects, seed, among)
    corners = shape.corners[~shape.held]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    scenario = Scenario(
        effects=hidden,
        disturbances=tuple(draw_disturbance(name, seed) for name in disturbances),
        sequences=_SEQUENCES,
        size=shape.size,
        mass=round(1000.0 * shape.volume, 5),
        density=round(_POINTS * float(np.linalg.norm(across, axis=1).sum()) / 2),
        # A slip of a millimetre is not noticed, and the body is not put back.
        put_back=all(one.effect != "base_slip" for one in hidden),
    )
    return ShapeScenario(family=family, seed=seed, scenario=scenario)


def make_shape_dataset(
    folder: Path, drawn: ShapeScenario, seed: int, workers: int = 1, report: Report = silent
) -> Truth:
    """Make the dataset `folder` and its truth beside it, both whole or neither.

    Raises RunError where `folder` exists.
    """
    truth = write_atomically(folder, lambda aside: _fill(aside, drawn, seed, workers, report))
    report(1.0, f"made {folder.name}")
    return truth


def _fill(folder: Path, drawn: ShapeScenario, seed: int, workers: int, report: Report) -> Truth:
    rng, scenario, body = np.random.default_rng([seed, 1]), drawn.scenario, ShapeMesher(drawn.true)
    seen = rng.choice([-1.0, 1.0], size=2)
    robot_from_phantom = Transform(
        Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.25, 0.25, 3)
    )
    report(0.0, "letting the body settle")
    rest, settled, faces = rest_surface(scenario, body)
    camera = draw_camera(scenario, (rest + settled, faces), seen, rng)
    camera = replace(camera, sees_table=drawn.table)
    scene = CameraScene((rest + settled, faces), None, np.array([0.0, 0.0, -1.0]), 1.0)
    shift = draw_camera_shift(scenario, rng)
    write_ply(folder / "rest.ply", camera.cloud(scene, rng))
    write_surface(folder / "phantom.stl", drawn.stated.vertices, drawn.stated.triangles)
    marks = _marks(drawn.stated)
    bench = Bench(
        body=drawn.true,
        radius=true_radius(scenario),
        marks=tuple(marks),
        touched=_touched(drawn, marks, (rest, settled), rng),
        robot_from_phantom=robot_from_phantom,
        phantom_from_camera=camera.phantom_from_camera,
    )
    relate = ROBOT_RELATIONS[drawn.robot]
    calibrated = relate(bench, folder, np.random.default_rng([seed, 51]))
    name = f"{drawn.family}-{rng.integers(16**4):04x}"
    write_config(folder / "dataset.toml", name, scenario, marks, None, "phantom.stl", calibrated)
    jobs = [
        SequenceJob(
            scenario,
            motion,
            camera,
            robot_from_phantom,
            shift,
            seen,
            folder / "sequences" / motion.name,
            seed,
            body=body,
        )
        for motion in _motions(drawn, camera, seed)
    ]
    return replace(record_all(jobs, workers, report), cast=drawn.cast)


def _marks(shape: Shape) -> dict[str, FloatArray]:
    """Landmarks (3,) [m] by name, spread over the upper part of the surface."""
    places, _ = reachable_places(shape, "poke-top", point_above(shape), 5e-3)
    sides, _ = reachable_places(shape, "poke-side", point_above(shape), 5e-3)
    every = np.concatenate([places, sides])
    chosen = every[spread_places(every, _MARKS)]
    return {f"mark_{number}": np.round(place, 5) for number, place in enumerate(chosen, start=1)}


def _touched(
    drawn: ShapeScenario,
    marks: dict[str, FloatArray],
    surface: tuple[FloatArray, FloatArray],
    rng: np.random.Generator,
) -> FloatArray:
    """Touch the marks (n, 3) [m] on the true body, with the error of a careful hand."""
    scenario, (rest, settled) = drawn.scenario, surface
    places = drawn.on_true(np.array(list(marks.values())))
    near = [int(np.linalg.norm(rest - place, axis=1).argmin()) for place in places]
    touched = places + settled[near] + (0.0, 0.0, scenario.touch_offset)
    return np.asarray(touched + rng.normal(size=touched.shape) * TOUCH_NOISE)


def _motions(drawn: ShapeScenario, camera: DepthCamera, seed: int) -> list[MotionPlan]:
    """Plan the sequences, each with places of its own."""
    shape, radius = drawn.true, drawn.scenario.tool_radius
    eye, found = camera.phantom_from_camera.translation, []
    names = drawn.scenario.sequences
    for kind in dict.fromkeys(name.rpartition("-")[0] for name in names):
        own = [name for name in names if name.startswith(kind)]
        rng = np.random.default_rng([seed, 33, *kind.encode()])
        places, normals = reachable_places(shape, kind, eye, radius)
        mixed = rng.permutation(len(places))
        chosen = mixed[spread_places(places[mixed], _PUSHES * len(own))]
        over = _over_lump(drawn, places)
        for number, name in enumerate(own):
            rows, felt = np.asarray(chosen[number :: len(own)], dtype=np.int64), over
            if is_upright(normals):
                near = rng.permutation(on_one_side(normals, int(rows[0])))
                near = np.append(rows[:1], near[near != rows[0]])
                felt = np.intersect1d(over, near)
                rows = near[spread_places(places[near], _PUSHES)]
            if len(felt) > 1:
                rows = np.append(rows[:1], rng.choice(felt, _PUSHES - 1, replace=False))
            found.append(push_motion(name, shape, places[rows], normals[rows], radius, rng))
    return sorted(found, key=lambda one: names.index(one.name))


def _over_lump(drawn: ShapeScenario, places: FloatArray) -> IntArray:
    """Rows of places (n, 3) [m] from which a hidden lump or tube can be felt; none without one."""
    lump, tube = (drawn.scenario.hidden(name) for name in ("stiff_inclusion", "stiff_tube"))
    felt = np.zeros(len(places), dtype=bool)
    if lump is not None:
        felt |= beyond_inclusion(lump, places) < _FELT
    if tube is not None:
        middle = (drawn.true.low + drawn.true.high)[:2] / 2
        felt |= beyond_tube(tube, places, middle) < _FELT
    return np.flatnonzero(felt)
