"""Distance between two models under a push that was not made yet, over everything that blurs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.design.candidate_pushes import Push
from palpate.diagnosis.inference.effect_derivative import stepped_setup
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import smooth_basis
from palpate.diagnosis.inference.nuisances import poisson_change
from palpate.effects import NuisanceBlock
from palpate.fem.constitutive.stiffness_field import lump_share
from palpate.fem.mesh_quadrature import element_quadrature
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.gradients.displacement_changes import displacement_changes
from palpate.gradients.setup_change import TOOL_STEP
from palpate.gradients.stiffness_derivatives import stiffness_changes
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Inclusion, Setup

__all__ = ["Scene", "Survivor", "nats_of", "survivor"]

_SHAFT = np.array(CRITERIA.design.shaft_places)
"""Places along the shaft [m] at which spheres of the tool's radius stand for it."""


_OPEN = (
    NuisanceBlock.TOOL_POSITION,
    NuisanceBlock.TOOL_ROTATION,
    NuisanceBlock.TOOL_RADIUS,
    NuisanceBlock.POISSON_RATIO,
)
"""Nuisances whose uncertainty blurs the prediction of a push."""


@dataclass(frozen=True, eq=False)
class Survivor:
    """A model that the data so far do not exclude, with its uncertainty.

    Attributes:
        setup: of the model.
        varied: its setup with one search coordinate a little changed, and the step.
        covariance: of the tool's motion and radius, Poisson's ratio, and the k `varied`
            coordinates (8 + k, 8 + k); None for a model that is imagined and not fitted.
    """

    setup: Setup
    varied: tuple[tuple[Setup, float], ...] = ()
    covariance: FloatArray | None = None

    @property
    def ways(self) -> list[tuple[Setup, float]]:
        """Setups that differ a little, and the steps.

        The order is that of the covariance after the tool's motion.
        """
        tool = self.setup.tool
        wider = replace(self.setup, tool=replace(tool, radius=tool.radius + TOOL_STEP))
        return [(wider, TOOL_STEP), poisson_change(self.setup), *self.varied]


def survivor(evaluator: Evaluator, model: Model) -> Survivor:
    """Return a fitted model with the covariance of its nuisances and parameters."""
    covariance = fit(
        evaluator.tempered(model), [*model.nuisance, *model.columns], evaluator.precision(model)
    ).covariance
    used, varied, at = list(evaluator.problem.blocks.places(*_OPEN)), [], len(model.nuisance)
    stated, step = evaluator.problem.setup, CRITERIA.design.step
    for index, effect in enumerate(model.effects):
        for number in range(len(effect.numbers())):
            # A single push has no derivative where it depends on the frames before it.
            if not (effect.kinked or effect.has_history()):
                varied.append(stepped_setup(stated, model.effects, index, number, step))
                used.append(at)
            at += 1
    return Survivor(model.setup, tuple(varied), covariance[np.ix_(used, used)])


@dataclass(frozen=True, eq=False)
class Scene:
    """Data that all candidate pushes share.

    Attributes:
        stated: the baseline.
        lumps: places at which the engine's stiffness is uncertain.
        centres: of the patches (p, 3) [m].
        normals: of the patches (p, 3).
        count: points of each patch in a cloud (p,).
        variance: of one point (p,) [m^2].
        eye: place of the camera (3,) [m].
        pivot: (3,) about which the robot's registration turns [m].
        grid: mesh.
        temperature: by which nats are divided.
    """

    stated: Survivor
    lumps: tuple[Inclusion, ...]
    centres: FloatArray
    normals: FloatArray
    count: FloatArray
    variance: FloatArray
    eye: FloatArray
    pivot: FloatArray
    grid: Meshing
    temperature: float

    @cached_property
    def basis(self) -> FloatArray:
        """Columns of smooth errors of displacement (p, b)."""
        return smooth_basis(self.centres, CRITERIA.noise.field_length)


class _Replayed:
    """One model under one push.

    Args:
        scene: of all pushes.
        model: to be replayed.
        push: to be made.
        like: another model whose equilibria are starts.
    """

    def __init__(
        self, scene: Scene, model: Survivor, push: Push, like: _Replayed | None = None
    ) -> None:
        self.scene, self.model, self.block = (
            scene,
            model,
            Replay(model.setup, scene.grid, CRITERIA.replay.design_tolerance),
        )
        stated = scene.stated.setup
        late = model.setup.sensor.time_offset - stated.sensor.time_offset
        centres = touch_correction(model.setup, scene.grid).apply(
            push.centres(stated.tool.radius, late)
        )
        slides = model.setup.support.friction_coefficient is not None or model.setup.has_history
        self.late = [(0.0 if row else -push.speed) * push.direction for row in range(len(centres))]
        used = [
            0,
            1,
            *([2] if any(push.along) or model.setup.material.has_history else []),
            *([3] if slides else []),
        ]
        self.frames: dict[int, Equilibrium] = {}
        previous: Equilibrium | None = None
        for row in used:
            near = None if like is None or model.setup.has_history else like.frames.get(row)
            previous = self.frames[row] = self.block.solve_from_any(
                centres[row], (near, previous), float(push.times[row])
            )
        self._engine: dict[int, FloatArray] = {}

    def moved(self, row: int) -> FloatArray:
        """Return the displacement of the patches from rest (p, 3) [m]; zero where nothing of the
        push is left.
        """
        if row not in self.frames:
            return np.zeros_like(self.scene.centres) if row == 3 else self.moved(1)
        return np.asarray(
            self.frames[row].move(self.scene.centres) - self.block.free.move(self.scene.centres)
        )

    @property
    def failed(self) -> bool:
        """Whether some frame found no equilibrium."""
        return any(frame.outcome is not Outcome.CONVERGED for frame in self.frames.values())

    @property
    def has_columns(self) -> bool:
        """Whether frames are independent of each other, so that they have derivatives."""
        return not self.model.setup.has_history

    def _along_normals(self, frame: Equilibrium, fields: FloatArray) -> FloatArray:
        changed = [frame.mesh.interpolate(field, self.scene.centres) for field in fields]
        return np.asarray(
            np.einsum(
                "kpi,pi->pk", np.array(changed).reshape(len(fields), -1, 3), self.scene.normals
            )
        )

    def open(self, row: int) -> FloatArray:
        """Return the model's uncertainty (p, k) [m], as independent columns of unit variance."""
        frame, covariance, ways = self.frames.get(row), self.model.covariance, self.model.ways
        if frame is None or covariance is None or not frame.in_contact or not self.has_columns:
            return np.zeros((len(self.scene.centres), 0 if covariance is None else len(covariance)))
        setup, steps = (
            self.model.setup,
            [(self.model.setup, TOOL_STEP * axis) for axis in np.eye(3)],
        )
        steps += [
            (other, (other.sensor.time_offset - setup.sensor.time_offset) * self.late[row])
            for other, _ in ways
        ]
        changed = displacement_changes(self.block, frame, steps)
        tool = changed[:3] / TOOL_STEP
        turned = [
            np.tensordot(np.cross(axis, frame.tool.centre - self.scene.pivot), tool, axes=1)
            for axis in np.eye(3)
        ]
        scaled = changed[3:] / np.array([step for _, step in ways])[:, None, None]
        fields = np.concatenate([tool, np.array(turned), scaled])
        return np.asarray(self._along_normals(frame, fields) @ _root(covariance))

    def engine(self, row: int) -> FloatArray:
        """Return the engine's own error (p, k) [m], as independent columns of unit variance."""
        if row not in self._engine:
            self._engine[row] = self._errors(row)
        return self._engine[row]

    def _errors(self, row: int) -> FloatArray:
        size = np.linalg.norm(self.moved(row), axis=1)[:, None]
        found = [CRITERIA.noise.displacement_error * size * self.scene.basis]
        frame = self.frames.get(row)
        if frame is None or not frame.in_contact or not self.has_columns or not self.scene.lumps:
            return np.concatenate([*found, np.zeros((len(size), len(self.scene.lumps)))], axis=1)
        factors = np.array(
            [lump_share(lump, element_quadrature(frame.mesh)) for lump in self.scene.lumps]
        )
        found.append(
            CRITERIA.noise.stiffness_error
            * self._along_normals(frame, stiffness_changes(self.block, frame, factors))
        )
        return np.concatenate(found, axis=1)


def _root(covariance: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _weights(scene: Scene, push: Push, moved: FloatArray, centre: FloatArray) -> FloatArray:
    """Return inverse variances (p,) [1/m^2]; zero where a patch is hidden."""
    seen = scene.count >= CRITERIA.design.least_points
    places = scene.centres + moved
    ray = places - scene.eye
    for stands in centre - _SHAFT[:, None] * push.direction:
        along = np.clip(ray @ (stands - scene.eye) / np.einsum("pi,pi->p", ray, ray), 0.0, 1.0)
        past = np.linalg.norm(scene.eye + along[:, None] * ray - stands, axis=1)
        seen &= (past > scene.stated.setup.tool.radius) | (along >= 1.0)
    return np.where(
        seen,
        1 / (scene.variance / np.maximum(scene.count, 1) + CRITERIA.design.white_floor**2),
        0.0,
    )


def nats_of(
    scene: Scene, pairs: Sequence[tuple[Survivor, Survivor]], push: Push
) -> list[tuple[float, float]]:
    """Return for each pair the divergence of half the push and of all of it [nats].

    It is zero where a model has no equilibrium.

    Args:
        scene: of all pushes.
        pairs: of models.
        push: to be made.
    """
    known: dict[int, _Replayed] = {}

    def replayed(model: Survivor) -> _Replayed:
        if id(model) not in known:
            known[id(model)] = _Replayed(scene, model, push, next(iter(known.values()), None))
        return known[id(model)]

    found = []
    for one, other in pairs:
        both = replayed(one), replayed(other)
        engine = next((side for side in both if side.has_columns), None) or replayed(scene.stated)
        if any(side.failed for side in (*both, engine)):
            found.append((0.0, 0.0))
            continue
        rows = sorted({row for side in both for row in side.frames})
        parts = [_part(scene, push, both, engine, row) for row in rows]
        found.append(
            (_divergence(parts[:1]) / scene.temperature, _divergence(parts) / scene.temperature)
        )
    return found


_Part = tuple[FloatArray, FloatArray, FloatArray]


def _part(
    scene: Scene, push: Push, both: tuple[_Replayed, _Replayed], engine: _Replayed, row: int
) -> _Part:
    """Return difference (p,), blur (p, k) and weights (p,) of one cloud."""
    moved = [side.moved(row) for side in both]
    difference = np.einsum("pi,pi->p", moved[1] - moved[0], scene.normals)
    # The mean of both models' predictive covariances stands for each.
    blur = np.concatenate(
        [engine.engine(row), *(side.open(row) / np.sqrt(2) for side in both)], axis=1
    )
    centre = push.centres(scene.stated.setup.tool.radius)[row]
    return difference, blur, _weights(scene, push, moved[0], centre)


def _divergence(parts: Sequence[_Part]) -> float:
    """Return half the squared distance of two Gaussians with one covariance, of noise and blur
    (Woodbury).
    """
    difference, blur, weights = (np.concatenate(values) for values in zip(*parts, strict=True))
    inner = np.eye(blur.shape[1]) + (blur.T * weights) @ blur
    right = (blur.T * weights) @ difference
    return float(
        0.5 * (difference @ (weights * difference) - right @ np.linalg.solve(inner, right))
    )
