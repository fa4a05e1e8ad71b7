"""The blind suite: datasets with one hidden effect each, with what no effect expresses, and with nothing, diagnosed by a process
that is not told."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from core.errors import RunError
from core.progress import Report, silent

__all__ = ["Case", "Result", "all_cases", "run_case", "run_suite", "scenario_of"]

TRIES = 400


@dataclass(frozen=True)
class Case:
    """One dataset to be made: its name, the seed of everything random in it, and the effect or disturbance (None in a control)."""

    name: str
    seed: int
    effect: str | None


@dataclass(frozen=True)
class Result:
    """What was hidden and what was said.

    Attributes:
        hidden, named: effects with their parameters, as in a truth file and in a report.
        gain, bound: of the named causes, or of the best that was not named, and the least that is [nats].
        removed: share of the reducible error that the named causes remove on test sequences [1], if any.
        seconds: of the diagnosis alone. outside: name of the disturbance that no effect of the catalogue expresses, if any.
    """

    name: str
    seed: int
    hidden: list[dict[str, Any]]
    verdict: str
    named: list[dict[str, Any]]
    gain: float
    bound: float
    removed: float | None
    seconds: float
    outside: str = ""

    @property
    def right(self) -> bool:
        """Whether exactly what is hidden was named; of what lies outside the catalogue, whether no single cause was."""
        if self.outside:
            return self.verdict in ("unexplained", "ambiguous")
        wanted = {one["effect"] for one in self.hidden}
        return self.verdict == ("found" if wanted else "none") and {one["effect"] for one in self.named} == wanted


def all_cases(seed: int, controls: int = 10, effects: Sequence[str] | None = None) -> list[Case]:
    """Each effect once, each disturbance once, and the controls; every case has a seed of its own.

    Effects are those that a diagnosis weighs, or the ones named, of which the virtual bench can hide more; an unknown one is a
    RunError.
    """
    from core.synthetic import DISTURBANCES, HIDDEN, WEIGHED  # noqa: PLC0415 (heavy)

    wanted, known = WEIGHED if effects is None else effects, list(HIDDEN)
    if strange := [effect for effect in wanted if effect not in known]:
        raise RunError(f"the virtual bench cannot hide {', '.join(strange)}; it knows {', '.join(known)}", effect=strange[0])
    cases = [Case(f"{effect}-{seed}", 1000 * seed + 1 + known.index(effect), effect) for effect in wanted]
    if effects is None:
        cases += [Case(f"{name}-{seed}", 1000 * seed + 401 + place, name) for place, name in enumerate(DISTURBANCES)]
    return cases + [Case(f"control-{seed}-{place:02d}", 1000 * seed + 500 + place, None) for place in range(controls)]


def run_suite(folder: Path, cases: Sequence[Case], workers: int, report: Report = silent) -> list[Result]:
    """The results of all cases, in their order; those in `folder`/results.jsonl are taken from there, new ones are added to it."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "results.jsonl"
    known = {result.name: result for result in _read(file)}
    wanted = [case for case in cases if case.name not in known]
    done = len(cases) - len(wanted)
    report(done / max(1, len(cases)), f"{done} of {len(cases)} were there already")
    pool = ProcessPoolExecutor(workers, mp_context=get_context("forkserver"), max_tasks_per_child=1)
    try:
        futures: list[Future[Result]] = [pool.submit(run_case, case, folder) for case in wanted]
        for future in as_completed(futures):
            result = future.result()
            known[result.name] = result
            with file.open("a") as stream:
                stream.write(json.dumps(asdict(result)) + "\n")
            done += 1
            report(done / len(cases), f"{result.name}: {result.verdict}")
    finally:
        _end(pool)
    return [known[case.name] for case in cases if case.name in known]


def run_case(case: Case, folder: Path) -> Result:
    """Make the dataset, diagnose it without a look at the truth, and compare; nothing but the result is kept."""
    from core.dataset import open_dataset  # noqa: PLC0415 (heavy)
    from core.diagnosis import diagnose  # noqa: PLC0415 (heavy)
    from core.synthetic import make_dataset  # noqa: PLC0415 (heavy)

    place = Path(tempfile.mkdtemp(prefix=f".{case.name}-", dir=folder))
    try:
        truth = make_dataset(place / "dataset", scenario_of(case), case.seed)
        began = time.monotonic()
        said = diagnose(open_dataset(place / "dataset"), place / "run", workers=1, replays=False)
        seconds = time.monotonic() - began
    finally:
        shutil.rmtree(place, ignore_errors=True)
    removed = ((said.get("gain") or {}).get("reducible_removed") or {}).get("value")
    evidence = said["evidence"]
    gain = evidence["gain_nats"] if said["causes"] else max(row["gain_nats"] for row in said["ranking"])
    return Result(
        case.name, case.seed, truth.as_dict()["effects"], said["verdict"], said["causes"], gain, evidence["bound_nats"], removed,
        round(seconds, 1), "".join(one.name for one in truth.disturbances),
    )  # fmt: skip


def scenario_of(case: Case) -> Any:
    """The first scenario drawn from the case's seeds that hides this effect at a clear size."""
    from core.synthetic import DISTURBANCES, HIDDEN, WEIGHED, Scenario, draw_disturbance, draw_scenario  # noqa: PLC0415 (heavy)

    if case.effect is None:
        return Scenario()
    if case.effect in DISTURBANCES:
        return Scenario(disturbances=(draw_disturbance(case.effect, case.seed),))
    if case.effect in HIDDEN and case.effect not in WEIGHED:
        return draw_scenario(TRIES * case.seed, among=(case.effect,))
    for attempt in range(TRIES):
        scenario = draw_scenario(TRIES * case.seed + attempt)
        if scenario.hidden(case.effect) is not None:
            return scenario
    raise RunError(f"{TRIES} draws hid no {case.effect}; is it in the virtual bench's list?", effect=case.effect)


def _read(file: Path) -> list[Result]:
    if not file.is_file():
        return []
    results = []
    for number, line in enumerate(file.read_text().splitlines(), 1):
        try:
            results.append(Result(**json.loads(line)))
        except (ValueError, TypeError) as error:
            text = f"{file}, row {number} is not a result ({error}); remove the row to have it done again"
            raise RunError(text, row=number) from error
    return results


def _end(pool: ProcessPoolExecutor) -> None:
    """Stop what still runs: an interrupted suite leaves no process behind."""
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()
