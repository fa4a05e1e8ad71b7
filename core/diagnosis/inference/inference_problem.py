"""The bench on which hypotheses are evaluated and refitted: setup, workers, noise and priors in one
place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.history_replay import TRACED
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS, Wanted
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.worker_pool import Pending, Workers
from palpate.diagnosis.inference.applicable_effects import weighed
from palpate.diagnosis.inference.effect_derivative import Tangent, changed_at_rest
from palpate.diagnosis.inference.evaluate import led
from palpate.diagnosis.inference.evidence import Block, fit, log_evidence, predictive_score
from palpate.diagnosis.inference.gauss_newton import fitted
from palpate.diagnosis.inference.hypothesis import Model, Nuisances, nuisance_setups
from palpate.diagnosis.inference.mesh_discrepancy import OWN_GRID, under_stated, with_columns
from palpate.diagnosis.inference.noise_model import Noise, noises
from palpate.diagnosis.inference.rest_evidence import Still
from palpate.effects import Effect
from palpate.effects.base import with_effects
from palpate.effects.geometry import MeshResolution
from palpate.foundation.arrays import FloatArray
from palpate.foundation.progress import Report, silent
from palpate.measurement.surface_gaps import Surface
from palpate.mesh.protocol import Meshing
from palpate.registration.registration import Registration
from palpate.setup.setup import Inclusion, Setup

__all__ = ["Bench"]


class Bench:
    """Evaluates hypotheses about one dataset: stated setup, workers, noise and priors in one place.

    Attributes:
        weighed: effects that this data can tell.
        seen: whether any sequence has clouds.
        pushed: places and outward normals (k, 3) of the pushes without clouds, under which a lump
            is looked for.
    """

    def __init__(
        self,
        setup: Setup,
        registration: Registration,
        workers: Workers,
        names: Sequence[str],
        static: Still | None,
        grid: Meshing,
        fine: Meshing,
        report: Report = silent,
        forces: bool = False,
        seen: bool = True,
    ) -> None:
        self.setup, self.registration, self.workers, self.static = (
            setup,
            registration,
            workers,
            static,
        )
        self.names, self._report, self._done = tuple(names), report, 0.0
        self.grid, self.fine, self.rough = grid, fine, grid
        self.nuisances = Nuisances.of(registration.repaired, forces)
        self._first = TOOL_COLUMNS + 8 + forces
        self.weighed: tuple[type[Effect], ...] = weighed(setup, seen=seen, forces=forces)
        self.seen = seen
        self.pushed = (np.empty((0, 3)), np.empty((0, 3)))
        self.temperature = 1.0
        self.noises: list[Noise] = []
        self.on_own_grid: tuple[Prediction, ...] = ()
        self.evaluations = 0
        self.known: list[Model] = []

    @cached_property
    def surface(self) -> Surface:
        """What the camera sees; SetupError for what is no block."""
        return Surface(self.setup.box)

    def tell(self, text: str, done: float = 0.0) -> None:
        """Report what is being done; the share that is done [1] never falls."""
        self._done = max(self._done, done)
        self._report(self._done, text)

    # -- evaluation -------------------------------------------------------------------------------------------------------------

    def _moved(self, effects: Sequence[Effect], index: int, number: int) -> tuple[Setup, float]:
        """The setup with one search coordinate a little larger, and the step."""
        effect, item = effects[index], effects[index].numbers()[number]
        coordinates, step = effect.coordinates, CRITERIA.derivatives.step * item.scale
        if item.coordinate(item.high) - coordinates[number] < step:
            step = -step
        coordinates[number] += step
        changed = [*effects[:index], effect.at(coordinates), *effects[index + 1 :]]
        return with_effects(self.setup, changed), step

    def _wanted(
        self,
        effects: Sequence[Effect],
        setup: Setup,
        tangents: Sequence[Tangent],
        lumps: Sequence[Inclusion],
    ) -> Wanted:
        pairs = nuisance_setups(setup, self.nuisances.forces)
        for index, effect in enumerate(effects):
            for number in range(len(effect.numbers())):
                alone = isinstance(effect, (*TRACED, MeshResolution))
                pairs.append((setup, 1.0) if alone else self._moved(effects, index, number))
        pairs += [tangent.changed(setup) for tangent in tangents]
        return Wanted(
            setups=tuple(s for s, _ in pairs),
            steps=tuple(h for _, h in pairs),
            lumps=tuple(lumps),
            pivot=self.registration.robot_pivot,
        )

    def predict(
        self,
        effects: Sequence[Effect],
        wanted: Wanted | None,
        starts: Sequence[Prediction] | None,
        grid: Meshing | None = None,
        tolerance: float = CRITERIA.replay.tolerance,
    ) -> list[Pending]:
        """Begin the replays of all sequences with these effects."""
        self.evaluations += 1
        return self.workers.submit(
            self.names,
            with_effects(self.setup, effects),
            grid or self.grid,
            wanted,
            starts,
            tolerance,
        )

    def evaluate(
        self,
        effects: Sequence[Effect],
        starts: Sequence[Prediction] | None = None,
        tangents: Sequence[Tangent] = (),
        lumps: Sequence[Inclusion] = (),
    ) -> Model:
        """The hypothesis with these effects; columns of `tangents` and `lumps` are wanted too."""
        setup = with_effects(self.setup, effects)
        if any(isinstance(effect, TRACED) for effect in effects):
            return self.assemble(
                tuple(effects),
                setup,
                led(self, effects, starts, tangents, lumps),
                tangents,
                len(lumps),
            )
        predictions = [
            f.result()
            for f in self.predict(effects, self._wanted(effects, setup, tangents, lumps), starts)
        ]
        model = self.assemble(tuple(effects), setup, predictions, tangents, len(lumps))
        self.known = [*self.known[:1], model]
        return model

    def assemble(
        self,
        effects: tuple[Effect, ...],
        setup: Setup,
        predictions: Sequence[Prediction],
        tangents: Sequence[Tangent],
        lumps: int,
    ) -> Model:
        """Quadratic forms and the meaning of their columns."""
        count = predictions[0].columns.shape[2]
        at = self._first
        own = sum(len(effect.numbers()) for effect in effects)
        columns, at = tuple(range(at, at + own)), at + own
        extra = {"tangents": tuple(range(at, at + len(tangents)))}
        at += len(tangents)
        extra["lumps"] = tuple(range(at, at + lumps))
        nuisance = (*range(self._first), count)
        if not self.noises:
            return Model(
                effects, setup, tuple(predictions), (), columns, extra, nuisance, tuple(tangents)
            )
        blocks = [noise.block(item) for noise, item in zip(self.noises, predictions, strict=True)]
        model = Model(
            effects, setup, tuple(predictions), (), columns, extra, nuisance, tuple(tangents)
        )
        return replace(model, blocks=(*blocks, *self._still(model, count, {})))

    def _still(
        self, model: Model, count: int, varied: dict[int, tuple[Setup, float]]
    ) -> list[Block]:
        """What was measured without a push, of `count` columns and the mesh's error: the model's
        own, and those `varied`.
        """
        if not self.static:
            return []
        found, at = (
            {**varied, **changed_at_rest(model.tangents, model.extra["tangents"], model.setup)},
            0,
        )
        for index, effect in enumerate(model.effects):
            for number in range(len(effect.numbers())):
                if effect.at_rest():
                    found[model.columns[at]] = self._moved(model.effects, index, number)
                at += 1
        return [self.static.block(self.setup, model.setup, self.grid, count + 1, found)]

    # -- baseline and noise -----------------------------------------------------------------------------------------------------

    def baseline(
        self,
        tangents: Sequence[Tangent],
        lumps: Sequence[Inclusion],
        effects: Sequence[Effect] = (),
    ) -> Model:
        """The stated setup with these effects on two meshes; from here on the noise is known."""
        model = self.evaluate(effects, tangents=tangents, lumps=lumps)
        own, known = model.predictions, list(effects)
        if model.setup.element_size is not None:
            known.append(OWN_GRID)
            own = self.on_own_grid = with_columns(
                [f.result() for f in self.predict(known, None, own)], own
            )
        fine = [f.result() for f in self.predict(known, None, own, self.fine)]
        places, surface = model.extra["lumps"], self.surface if self.seen else None
        self.noises = under_stated(
            noises(own, fine, surface, slice(places[0], places[-1] + 1)), model.predictions
        )
        model = self.assemble(tuple(effects), model.setup, model.predictions, tangents, len(lumps))
        self.temperature = self.misfit(model)
        return model

    def block_with(
        self, model: Model, signatures: Sequence[tuple[Effect, Sequence[Prediction]]], origin: Model
    ) -> Model:
        """The model with finite-size signatures as further columns before the last.

        Args:
            signatures: effects of a finite size and their predictions, whose difference from
                `origin` is the column.
        """
        blocks, count = [], model.predictions[0].columns.shape[2]
        for number, noise in enumerate(self.noises):
            here, zero = model.predictions[number], origin.predictions[number]
            for _, other in signatures:
                surface, force = other[number].change_from(zero)
                here = here.beside(surface[..., None], None if force is None else force[..., None])
            blocks.append(noise.block(here))
        places = tuple(range(count, count + len(signatures)))
        own = zip(places, (effect for effect, _ in signatures), strict=True)
        varied = {
            place: (effect.apply(model.setup), 1.0) for place, effect in own if effect.at_rest()
        }
        blocks += self._still(model, count + len(signatures), varied)
        nuisance = (*model.nuisance[:-1], count + len(signatures))
        return replace(
            model,
            blocks=tuple(blocks),
            nuisance=nuisance,
            extra={**model.extra, "signatures": places},
        )

    # -- scores -----------------------------------------------------------------------------------------------------------------

    def precision(self, model: Model, nuisances: FloatArray | None = None) -> FloatArray:
        """Prior precision of nuisances (as stated, unless given otherwise) and search
        coordinates."""
        size = len(model.nuisance) + len(model.columns)
        precision = np.zeros((size, size))
        precision[: len(model.nuisance), : len(model.nuisance)] = (
            self.nuisances.precision if nuisances is None else nuisances
        )
        own = np.arange(len(model.nuisance), size)
        precision[own, own] = (
            (CRITERIA.priors.parameter_steps * model.scales) ** -2 if len(own) else 0
        )
        return precision

    def held(self, model: Model, nuisances: FloatArray | None = None) -> FloatArray:
        """The same with no room for what lies at a bound and is pulled beyond it.

        A weight of nothing is no weight; with room for less than nothing it explained a block of
        another height.
        """
        precision, first, columns = (
            self.precision(model, nuisances),
            len(model.nuisance),
            [*model.nuisance, *model.columns],
        )
        ways = model.ends
        while (ways != 0).any():
            change = fit(self.tempered(model), columns, precision).change[first:]
            pressed = first + np.flatnonzero(ways * change > 0)
            if not len(pressed):
                break
            precision[pressed, pressed] = (
                CRITERIA.priors.bound_precision * model.scales[pressed - first] ** -2
            )
            ways[pressed - first] = 0
        return precision

    def tempered(self, model: Model) -> list[Block]:
        """Blocks divided by the misfit per value that the present best model leaves."""
        return [
            Block(
                block.name,
                block.gram / (self.temperature if block.name != "rest" else 1.0),
                block.values,
            )
            for block in model.blocks
        ]

    def misfit(self, model: Model) -> float:
        """Misfit per value with nuisances at their best; one when only noise is left."""
        blocks = [block for block in model.blocks if block.name != "rest"]
        best = fit(blocks, [*model.nuisance, *model.columns], self.held(model))
        return best.misfit / sum(block.values for block in blocks)

    def score(self, model: Model) -> FloatArray:
        """Log predictive density of each block given the others [nats]."""
        return predictive_score(
            self.tempered(model),
            [*model.nuisance, *model.columns],
            self.held(model),
            len(model.nuisance),
        )

    def objective(self, model: Model, nuisances: FloatArray | None = None) -> float:
        """Log evidence at these values of the search coordinates [nats]; `nuisances` as for
        `precision`.
        """
        return log_evidence(
            self.tempered(model),
            model.nuisance,
            self.nuisances.precision if nuisances is None else nuisances,
        )

    def refit(
        self,
        effects: Sequence[Effect],
        starts: Sequence[Prediction] | None,
        hopeless: float = -np.inf,
    ) -> Model:
        """Fit from these values (`palpate.diagnosis.inference.gauss_newton`); returns the best
        model met.

        A model whose log evidence will hardly reach `hopeless` is given up.
        """
        self.tell(f"fitting {' and '.join(effect.name for effect in effects)}")
        return fitted(self, self.evaluate(effects, starts), self.nuisances.precision, hopeless)

    def refine(self, model: Model) -> Model:
        """Fit an accepted model's parameters once more, with the mesh's error measured in it and
        not in the stated setup.

        What an effect does and a nuisance as well is now all the effect's. From here on models
        compare no longer with those scored before. Of what is remembered along the tool's whole
        way, dear on a fine mesh, the mesh's error is taken to be that of a replay which remembers
        nothing.
        """
        self.tell("fitting the causes once more on two meshes")
        plain = tuple(effect for effect in model.effects if not isinstance(effect, TRACED))
        if plain:
            here = (
                model.predictions
                if plain == model.effects
                else self.evaluate(plain, model.predictions).predictions
            )
            fine = [f.result() for f in self.predict(plain, None, here, self.fine)]
            self.noises = [
                n.remeshed(m, f) for n, m, f in zip(self.noises, here, fine, strict=True)
            ]
        found = self.assemble(model.effects, model.setup, model.predictions, (), 0)
        return fitted(
            self, found, self.nuisances.beside(found.effects), worth=CRITERIA.fits.settled
        )
