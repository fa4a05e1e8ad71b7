"""Comparison with other engines on the reference pokes: MuJoCo's flex and Newton's VBD.

Both are dynamic, so the ball sinks at 10 mm/s and rests for a third of a second before
displacements are read. Material, block, ball and grid are those of the reference, without friction
and gravity; other settings are those of the engines' own examples. The engines are installed by the
extra `peers`: pip install -e ".[peers]" -c constraints.txt, which `make bench` does.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
from rich.table import Table
from scipy.interpolate import RegularGridInterpolator

from benchmarks.cpu_time import timed
from benchmarks.reference_pokes import DEPTHS, SETUP, compared, reference, top_points
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.graded_mesh import REPLAY_GRID, Grading
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import replay, require_converged

__all__ = ["run"]

Nodes = tuple[int, int, int]
GRIDS: tuple[Nodes, ...] = ((13, 5, 5), (25, 9, 9))
RATE = 30.0
SPEED, REST = 10e-3, 1 / 3
"""Speed of the ball [m/s], and the time it rests at each depth [s]."""
SIZE, RADIUS = np.array(SETUP.geometry.size), SETUP.tool.radius
MODULUS, NU = SETUP.material.young_modulus, SETUP.material.poisson_ratio


class Engine(Protocol):
    """A running engine.

    Attributes:
        steps: time steps in a frame of 1 / 30 s.
    """

    steps: int

    def step(self, depth: float) -> None:
        """Move the ball to a depth [m] and take one time step."""

    def positions(self) -> FloatArray:
        """Return the positions (n, 3) [m] of all nodes."""

    def warnings(self) -> str:
        """Return the number of solver warnings; a dash for an engine without them."""


class MuJoCo:
    """MuJoCo's flex: Saint Venant-Kirchhoff tetrahedra.

    Measured: with 8 steps a frame instead of 16 the coarse grid warns of a singular matrix.
    """

    steps = 16

    def __init__(self, nodes: Nodes) -> None:
        import mujoco

        x, y, z = SIZE / (np.array(nodes) - 1)
        self.engine = mujoco
        # Warnings are counted below; by default MuJoCo writes them to the working directory.
        mujoco.set_mju_user_warning(lambda _: None)
        self.model = mujoco.MjModel.from_xml_string(f"""
            <mujoco>
              <option timestep="{1 / RATE / self.steps}" gravity="0 0 0" integrator="discrete"/>
              <worldbody>
                <flexcomp name="block" type="grid" dim="3"
                          count="{nodes[0]} {nodes[1]} {nodes[2]}" spacing="{x} {y} {z}"
                          pos="0 0 {SIZE[2] / 2}" radius="1e-5" mass="{SETUP.mass}">
                  <contact selfcollide="none" condim="1"/>
                  <elasticity young="{MODULUS}" poisson="{NU}" damping="0.01"/>
                  <pin gridrange="0 0 0 {nodes[0] - 1} {nodes[1] - 1} 0"/>
                </flexcomp>
                <body mocap="true" pos="0 0 {SIZE[2] + RADIUS}">
                  <geom type="sphere" size="{RADIUS}" condim="1"/>
                </body>
              </worldbody>
            </mujoco>""")
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def step(self, depth: float) -> None:
        self.data.mocap_pos[0, 2] = SIZE[2] + RADIUS - depth
        self.engine.mj_step(self.model, self.data)

    def positions(self) -> FloatArray:
        return np.array(self.data.flexvert_xpos)

    def warnings(self) -> str:
        return str(sum(int(kind.number) for kind in self.data.warning))


class Newton:
    """Newton's VBD: neo-Hookean tetrahedra by vertex block descent, 20 iterations a frame."""

    steps = 1
    skin = 1e-4
    """Contact radius of the nodes [m], by which the ball is made smaller."""

    def __init__(self, nodes: Nodes) -> None:
        import warp

        warp.config.log_level = warp.LOG_WARNING
        import newton

        cells, (x, y, z) = np.array(nodes) - 1, SIZE / (np.array(nodes) - 1)
        builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
        builder.add_soft_grid(
            pos=warp.vec3(-SIZE[0] / 2, -SIZE[1] / 2, 0.0),
            rot=warp.quat_identity(),
            vel=warp.vec3(0.0, 0.0, 0.0),
            dim_x=int(cells[0]),
            dim_y=int(cells[1]),
            dim_z=int(cells[2]),
            cell_x=x,
            cell_y=y,
            cell_z=z,
            density=SETUP.mass / SIZE.prod(),
            k_mu=MODULUS / (2 * (1 + NU)),
            k_lambda=MODULUS * NU / ((1 + NU) * (1 - 2 * NU)),
            k_damp=1.0,
            particle_radius=self.skin,
        )
        for node in np.flatnonzero(np.array(builder.particle_q)[:, 2] < 1e-9):
            builder.particle_mass[node] = 0.0
            builder.particle_flags[node] &= ~int(newton.ParticleFlags.ACTIVE)
        place = warp.transform(warp.vec3(0.0, 0.0, SIZE[2] + RADIUS), warp.quat_identity())
        ball = newton.ModelBuilder.ShapeConfig(mu=0.0, ke=1e3)
        builder.add_shape_sphere(
            builder.add_body(xform=place, is_kinematic=True), radius=RADIUS - self.skin, cfg=ball
        )
        builder.color()
        self.model: Any = builder.finalize(device="cpu")
        self.model.soft_contact_ke, self.model.soft_contact_kd, self.model.soft_contact_mu = (
            1e3,
            0.0,
            0.0,
        )
        self.solver = newton.solvers.SolverVBD(self.model, iterations=20)
        self.now, self.next = self.model.state(), self.model.state()
        self.control, self.contacts = self.model.control(), self.model.contacts()
        self.step(0.0)  # compiles

    def step(self, depth: float) -> None:
        bodies = self.now.body_q.numpy()
        bodies[0, 2] = SIZE[2] + RADIUS - depth
        for state in (self.now, self.next):
            state.body_q.assign(bodies)
        self.now.clear_forces()
        self.model.collide(self.now, self.contacts)
        self.solver.step(self.now, self.next, self.control, self.contacts, 1 / RATE / self.steps)
        self.now, self.next = self.next, self.now

    def positions(self) -> FloatArray:
        return self.now.particle_q.numpy().astype(float)

    def warnings(self) -> str:
        return "-"


OWN: tuple[tuple[str, GridSpec | Grading], ...] = (
    *(("Palpate, even hexahedra", GridSpec(nodes=nodes)) for nodes in GRIDS),
    ("Palpate, graded by size", REPLAY_GRID),
)

ENGINES: tuple[tuple[str, str, Callable[[Nodes], Engine]], ...] = (
    ("MuJoCo flex, tetrahedra", "mujoco", MuJoCo),
    ("Newton VBD, tetrahedra", "newton", Newton),
)


def _over_top(rest: FloatArray, moved: FloatArray, nodes: Nodes) -> FloatArray:
    """Return the displacement (m, 3) [m] of the reference points on the top.

    It is interpolated linearly between the nodes (n, 3) of the top.
    """
    top = np.flatnonzero(rest[:, 2] > SIZE[2] - 1e-6)
    rows = top[np.lexsort((rest[top, 1].round(7), rest[top, 0].round(7)))]
    axes = [np.linspace(-SIZE[axis] / 2, SIZE[axis] / 2, nodes[axis]) for axis in (0, 1)]
    change = (moved - rest)[rows].reshape(nodes[0], nodes[1], 3)
    return np.asarray(RegularGridInterpolator(axes, change)(top_points()[:, :2]))


def _depths(step: float) -> tuple[FloatArray, list[int]]:
    """Return the ball's depth (n,) [m] every `step` seconds, and the last index at each depth."""
    depths, held, before = np.zeros(0), [], 0.0
    for depth in DEPTHS:
        count = round((depth - before) / SPEED / step)
        sinking = before + (depth - before) * np.arange(1, count + 1) / count
        depths = np.concatenate([depths, sinking, np.full(round(REST / step), depth)])
        held.append(len(depths) - 1)
        before = depth
    return depths, held


def _poke(engine: Engine, nodes: Nodes) -> FloatArray:
    """Return the displacement (2, m, 3) [m] of the reference points at the two depths."""
    rest, shown = engine.positions(), []
    depths, held = _depths(1 / RATE / engine.steps)
    for number, depth in enumerate(depths):
        engine.step(float(depth))
        if number in held:
            shown.append(_over_top(rest, engine.positions(), nodes))
    return np.stack(shown)


def _own(grid: Meshing) -> FloatArray:
    depths, held = _depths(1 / RATE)
    frames = replay(
        SETUP, np.array([[0.0, 0.0, SIZE[2] + RADIUS - depth] for depth in depths]), grid
    )
    require_converged(frames)
    return compared([frames[number] for number in held]).displacement


def _row(
    table: Table, name: str, nodes: Nodes, displacement: FloatArray, seconds: float, warnings: str
) -> None:
    grid, ratio = "x".join(map(str, nodes)), f"{seconds * RATE / len(_depths(1 / RATE)[0]):.3f}"
    if not np.isfinite(displacement).all():
        table.add_row(name, grid, ratio, "not finite", "-", warnings)
        return
    expected = reference().displacement
    errors = np.linalg.norm(displacement - expected, axis=(1, 2)) / np.linalg.norm(
        expected, axis=(1, 2)
    )
    deepest = -1e3 * displacement[..., 2].min(axis=1)
    table.add_row(
        name,
        grid,
        ratio,
        f"{errors[0]:.0%} / {errors[1]:.0%}",
        f"{deepest[0]:.1f} / {deepest[1]:.1f}",
        warnings,
    )


def run() -> list[Table]:
    """Poke with every installed engine; report errors and CPU time per simulated second."""
    heads = (
        "engine",
        "nodes",
        "CPU s per s",
        "top off by, 4 / 8 mm",
        "top sunk by, mm",
        "solver warnings",
    )
    table = Table(*heads, title="Installed engines, one thread, the same pokes by 4 and 8 mm")
    for name, grid in OWN:
        _own(grid)  # warm-up
        displacement, seconds = timed(lambda grid=grid: _own(grid))  # type: ignore[misc]
        _row(
            table,
            name,
            grid.mesh(SETUP, np.array([0.0, 0.0, SIZE[2]])).shape,
            displacement,
            seconds,
            "0",
        )
    for name, package, start in ENGINES:
        if find_spec(package) is None:
            table.add_row(
                name, "-", "not installed", 'pip install -e ".[peers]" -c constraints.txt', "-", "-"
            )
            continue
        for nodes in GRIDS:
            engine = start(nodes)
            displacement, seconds = timed(lambda engine=engine, nodes=nodes: _poke(engine, nodes))  # type: ignore[misc]
            _row(table, name, nodes, displacement, seconds, engine.warnings())
    return [table]
