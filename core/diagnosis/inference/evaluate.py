"""Models from replays: predictions of all sequences under a hypothesis, and their columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.jacobian import JacobianRequest
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.worker_pool import Pending, Workers
from palpate.diagnosis.inference.effect_derivative import (
    SetupChange,
    changes_at_rest,
    stepped_setup,
    tangent_setup,
)
from palpate.diagnosis.inference.evaluate_history import history_predictions
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import InferenceProblem
from palpate.diagnosis.inference.noise.mesh_discrepancy import under_stated, with_columns
from palpate.diagnosis.inference.noise.noise_model import noises
from palpate.diagnosis.inference.nuisances import nuisance_setups
from palpate.diagnosis.inference.posterior import Posterior
from palpate.effects import Effect, Tangent
from palpate.effects.base import with_effects
from palpate.effects.geometry import DIAGNOSIS_GRID
from palpate.foundation.progress import Report, silent
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import AnyInclusion, Setup

__all__ = ["Evaluator", "SharedEvaluator"]


class Evaluator(Posterior):
    """Replays and scores hypotheses of one inference problem.

    Args:
        problem: to be solved.
        workers: processes that have the problem's sequences.
        report: progress; may raise Cancelled.

    Attributes:
        problem: as given.
        workers: as given.
        state: noise, temperature and counters.
    """

    def __init__(
        self, problem: InferenceProblem, workers: Workers, report: Report = silent
    ) -> None:
        super().__init__(problem)
        self.workers, self._report, self._expected = workers, report, ""

    def report(self, text: str, done: float = 0.0) -> None:
        """Report what is being done; the share that is done [1] never falls."""
        self.state.progress = max(self.state.progress, done)
        self._report(self.state.progress, text + self._expected)

    def expect(self, seconds: float | None) -> None:
        """State the expected duration of the search [s] behind every report; None to stop."""
        minutes = 0 if seconds is None else max(round(seconds / 60), 1)
        self._expected = f" (the search takes about {minutes} min)" if minutes else ""

    def predict(
        self,
        effects: Sequence[Effect],
        request: JacobianRequest | None,
        starts: Sequence[Prediction] | None,
        grid: Meshing | None = None,
        tolerance: float = CRITERIA.replay.tolerance,
    ) -> list[Pending]:
        """Begin the replays of all sequences with these effects.

        Args:
            effects: of the hypothesis.
            request: columns; none without it.
            starts: predictions to begin from, one for each sequence.
            grid: mesh; that of the diagnosis without it.
            tolerance: residual over the tool's push [1].
        """
        self.state.evaluations += 1
        return self.workers.submit(
            self.problem.names,
            with_effects(self.problem.setup, effects),
            grid or self.problem.grid,
            request,
            starts,
            tolerance,
        )

    def replayed(
        self,
        effects: Sequence[Effect],
        starts: Sequence[Prediction] | None,
        grid: Meshing | None = None,
    ) -> list[Prediction]:
        """Return predictions of all sequences without columns; arguments as for `predict`."""
        return self.finished(self.predict(effects, None, starts, grid))

    def finished(self, begun: Sequence[Pending]) -> list[Prediction]:
        """Wait for replays of all sequences and count their work."""
        predictions = [pending.result() for pending in begun]
        work = sum(prediction.solves for prediction in predictions)
        self.state.work += work
        self.state.unit = self.state.unit or work
        return predictions

    def evaluate(
        self,
        effects: Sequence[Effect],
        starts: Sequence[Prediction] | None = None,
        tangents: Sequence[Tangent] = (),
        inclusions: Sequence[AnyInclusion] = (),
    ) -> Model:
        """Replay a hypothesis and return it with its columns.

        Args:
            effects: of the hypothesis.
            starts: predictions to begin from, one for each sequence.
            tangents: further columns.
            inclusions: places of inclusions, which are further columns.
        """
        setup = with_effects(self.problem.setup, effects)
        if any(effect.has_history() for effect in effects):
            predictions = history_predictions(self, effects, starts, tangents, inclusions)
            return self.assemble(effects, setup, predictions, tangents, len(inclusions))
        request = self._request(effects, setup, tangents, inclusions)
        predictions = self.finished(self.predict(effects, request, starts))
        model = self.assemble(effects, setup, predictions, tangents, len(inclusions))
        self.state.recent = [*self.state.recent[:1], model]
        return model

    def _request(
        self,
        effects: Sequence[Effect],
        setup: Setup,
        tangents: Sequence[Tangent],
        inclusions: Sequence[AnyInclusion],
    ) -> JacobianRequest:
        pairs = nuisance_setups(setup, self.problem.forces)
        for index, effect in enumerate(effects):
            for number in range(len(effect.numbers())):
                pairs.append(
                    self._stepped(effects, index, number)
                    if effect.has_derivative()
                    else (setup, 1.0)
                )
        pairs += [tangent_setup(tangent, setup) for tangent in tangents]
        return JacobianRequest(
            setups=tuple(changed for changed, _ in pairs),
            steps=tuple(step for _, step in pairs),
            lumps=tuple(inclusions),
            pivot=self.problem.registration.robot_pivot,
        )

    def _stepped(self, effects: Sequence[Effect], index: int, number: int) -> SetupChange:
        return stepped_setup(self.problem.setup, effects, index, number, CRITERIA.derivatives.step)

    def assemble(
        self,
        effects: Sequence[Effect],
        setup: Setup,
        predictions: Sequence[Prediction],
        tangents: Sequence[Tangent] = (),
        inclusions: int = 0,
    ) -> Model:
        """Return the model with its quadratic forms, which need the noise to be known.

        Args:
            effects: of the hypothesis.
            setup: with them.
            predictions: one for each sequence.
            tangents: whose columns the predictions have.
            inclusions: number of places of inclusions whose columns they have.
        """
        count = predictions[0].columns.shape[2]
        layout = self.problem.blocks.columns(effects, len(tangents), inclusions, count)
        model = Model(tuple(effects), setup, tuple(predictions), (), layout, tuple(tangents))
        if not self.state.noises:
            return model
        blocks = [
            noise.block(item) for noise, item in zip(self.state.noises, predictions, strict=True)
        ]
        return replace(model, blocks=(*blocks, *self._at_rest(model, count, {})))

    def _at_rest(self, model: Model, count: int, varied: dict[int, SetupChange]) -> list[Block]:
        """Return the block of the data without a push; none without such data.

        Args:
            model: whose tangents and effects have columns.
            count: number of columns of a replay.
            varied: further columns.
        """
        problem = self.problem
        if not problem.at_rest:
            return []
        changes = {**varied, **changes_at_rest(model.tangents, model.layout.tangents, model.setup)}
        at = 0
        for index, effect in enumerate(model.effects):
            for number in range(len(effect.numbers())):
                if effect.at_rest():
                    changes[model.columns[at]] = self._stepped(model.effects, index, number)
                at += 1
        return [problem.at_rest.block(problem.setup, model.setup, problem.grid, count + 1, changes)]

    def baseline(
        self,
        tangents: Sequence[Tangent],
        inclusions: Sequence[AnyInclusion],
        effects: Sequence[Effect] = (),
        spots: int | None = None,
    ) -> Model:
        """Replay the stated setup with these effects on two meshes, which makes the noise known.

        Args:
            tangents: further columns.
            inclusions: places of inclusions, which are further columns.
            effects: of the model.
            spots: number of the first inclusions, in which the engine's stiffness may be off; all
                without it.
        """
        problem, state = self.problem, self.state
        model = self.evaluate(effects, tangents=tangents, inclusions=inclusions)
        own, known = model.predictions, list(effects)
        if model.setup.element_size is not None:
            known.append(DIAGNOSIS_GRID)
            own = state.on_diagnosis_grid = with_columns(self.replayed(known, own), own)
        fine = self.replayed(known, own, problem.fine_grid)
        places = model.layout.inclusions[:spots]
        surface = problem.surface if problem.clouds else None
        lumps, edge = slice(places[0], places[-1] + 1), problem.setup.sensor.edge
        state.noises = under_stated(noises(own, fine, surface, lumps, edge), model.predictions)
        model = self.assemble(effects, model.setup, model.predictions, tangents, len(inclusions))
        state.temperature = self.misfit(model)
        state.stated = self.objective(model)
        return model

    def with_signatures(
        self, model: Model, signatures: Sequence[tuple[Effect, Sequence[Prediction]]], origin: Model
    ) -> Model:
        """Return the model with effects of a finite size as further columns, before the last.

        Args:
            model: to be extended.
            signatures: effects and the predictions with each.
            origin: the model whose difference from these predictions is the column.
        """
        blocks, count = [], model.predictions[0].columns.shape[2]
        for number, noise in enumerate(self.state.noises):
            here, zero = model.predictions[number], origin.predictions[number]
            for _, other in signatures:
                surface, force = other[number].change_from(zero)
                here = here.append_columns(
                    surface[..., None], None if force is None else force[..., None]
                )
            blocks.append(noise.block(here))
        last = count + len(signatures)
        places = tuple(range(count, last))
        own = zip(places, (effect for effect, _ in signatures), strict=True)
        varied = {
            place: (effect.apply(model.setup), 1.0) for place, effect in own if effect.at_rest()
        }
        blocks += self._at_rest(model, last, varied)
        layout = replace(model.layout, nuisances=(*model.nuisance[:-1], last), signatures=places)
        return replace(model, blocks=tuple(blocks), layout=layout)


class SharedEvaluator(Evaluator):
    """Evaluates in another way for the same search: it shares the state of the evaluator that it is
    made from, and reports as that one does.

    Args:
        evaluator: of the inference problem.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        super().__init__(evaluator.problem, evaluator.workers)
        self.state, self._told = evaluator.state, evaluator

    def report(self, text: str, done: float = 0.0) -> None:
        """Report as the evaluator that it is made from does."""
        self._told.report(text, done)
