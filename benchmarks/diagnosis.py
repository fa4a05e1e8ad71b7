"""The whole catalogue on a large dataset: where the time goes, and how much memory it takes."""

from __future__ import annotations

import os
import resource
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from rich.table import Table

from palpate.dataset import Dataset, open_dataset
from palpate.diagnosis.pipeline import diagnose
from palpate.synthetic import HiddenEffect, Scenario, make_dataset

__all__ = ["MemoryWatch", "Steps", "run"]

SEQUENCES = ("poke-top-01", "poke-top-02", "poke-side-01", "poke-side-02", "drag-01", "drag-02")
HIDDEN = HiddenEffect(
    "stiff_inclusion",
    {"x": 0.006, "y": 0.002, "z": 0.0255, "radius": 0.0075, "stiffness_ratio": 6.0},
)
ROUNDS = {"drag-01": 2, "drag-02": 2}
"""One drag alone is over before the 20 s that are asked for."""
SCENARIO = Scenario(effects=(HIDDEN,), sequences=SEQUENCES, rounds=ROUNDS, density=8000, rate=30.0)
SEED, WORKERS = 11, 2
MOST_TIME, MOST_MEMORY = 300.0, 3e9
"""What a diagnosis of six sequences of 20 s may take [s], and of memory [bytes]."""
_LOWER = 0.98
"""Of the most that processes held, each by itself, from which on it is looked at how much that is
together [1]."""
STEPS = {
    "read": "clouds read and cleaned",
    "replaying the stated": "the stated setup replayed on two meshes",
    "what": "the catalogue screened",
    "fitting the causes once more": "the causes found fitted on two meshes",
    "fitting": "the most promising causes fitted",
    "looking": "a second cause looked for",
    "measuring": "the gain on test sequences",
    "trying": "controls, and sequences replayed for the page",
    "how far": "profiles of the parameters",
    "which": "the next probe",
    "replaying every": "the last sequences replayed for the page",
}
"""By the first words of what a diagnosis says it does; the first that fits."""


class Steps:
    """Adds up what a diagnosis reports: seconds of the clock by step."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.seconds: dict[str, float] = {}
        self._clock, self._since, self._step = clock, clock(), ""

    def __call__(self, fraction: float, text: str) -> None:
        now = self._clock()
        if self._step:
            self.seconds[self._step] = self.seconds.get(self._step, 0.0) + now - self._since
        self._since = now
        self._step = next(
            (name for words, name in STEPS.items() if text.startswith(words)),
            self._step or STEPS["read"],
        )


class MemoryWatch:
    """The most memory that this process and its children hold at once [bytes], pages they share
    counted once; a context manager.

    To count them takes the kernel 15 ms a process, and those wait meanwhile: done twice a second,
    it was 25 of a diagnosis' 527 seconds of processors. So it is done only where what they hold,
    each by itself, is near the most it was, which is soon told.
    """

    def __init__(self, interval: float = 0.5) -> None:
        self.most, self._interval = 0.0, interval
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> MemoryWatch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _watch(self) -> None:
        highest = 0.0
        while True:
            family = _family(os.getpid())
            now = sum(_resident(process) for process in family)
            if now > _LOWER * highest:
                highest = max(now, highest)
                self.most = max(self.most, sum(_held(process) for process in family))
            if self._stop.wait(self._interval):
                return


def _family(root: int) -> list[int]:
    """A process and all that it and they started."""
    found = [root]
    for process in found:
        for thread in Path(f"/proc/{process}/task").glob("*/children"):
            found += [int(child) for child in _text(thread).split()]
    return found


def _resident(process: int) -> float:
    """Resident set size [bytes], pages that it shares among them; zero for a process that is
    gone."""
    return float(
        resource.getpagesize() * int((_text(Path(f"/proc/{process}/statm")) or "0 0").split()[1])
    )


def _held(process: int) -> float:
    """Proportional set size [bytes]; zero for a process that is gone."""
    row = next(
        (
            line
            for line in _text(Path(f"/proc/{process}/smaps_rollup")).splitlines()
            if line.startswith("Pss:")
        ),
        "Pss: 0",
    )
    return 1024.0 * int(row.split()[1])


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""


def _size(dataset: Dataset) -> str:
    names = dataset.sequences
    clouds = [len(dataset.sequence(name)) for name in names]
    points = dataset.sequence(names[0]).count(0)
    seconds = [
        float(dataset.sequence(name).cloud_times[-1] - dataset.sequence(name).cloud_times[0])
        for name in names
    ]
    return f"{len(names)} sequences of {sum(seconds) / len(names):.0f} s, {sum(clouds)} clouds of about {points} points"


def run() -> list[Table]:
    """Make the dataset, diagnose it, check what is found, and tabulate."""
    with tempfile.TemporaryDirectory() as folder:
        make_dataset(Path(folder) / "block", SCENARIO, SEED, WORKERS)
        dataset, steps = open_dataset(Path(folder) / "block"), Steps()
        before, began = os.times(), time.perf_counter()
        with MemoryWatch() as watch:
            report = diagnose(dataset, Path(folder) / "run", workers=WORKERS, report=steps)
        spent, after = time.perf_counter() - began, os.times()
        size = _size(dataset)
    named = [cause["effect"] for cause in report["causes"]]
    if named != [HIDDEN.effect]:
        raise RuntimeError(
            f"{HIDDEN.effect} is hidden, found is {', '.join(named) or report['verdict']}"
        )
    processor = sum(
        getattr(after, name) - getattr(before, name)
        for name in ("user", "system", "children_user", "children_system")
    )
    table = Table("step", "time", "share", title=f"Diagnosis of {size}, {WORKERS} processes")
    for name, seconds in steps.seconds.items():
        table.add_row(name, f"{seconds:.0f} s", f"{100 * seconds / spent:.0f} %")
    table.add_section()
    table.add_row(
        "in all, by the clock", f"{spent:.0f} s", f"at most {MOST_TIME:.0f} s are aimed at"
    )
    table.add_row(
        "in all, of processors",
        f"{processor:.0f} s",
        f"{processor / WORKERS:.0f} s were both cores idle",
    )
    table.add_row(
        "memory", f"{watch.most / 1e9:.2f} GB", f"at most {MOST_MEMORY / 1e9:.0f} GB are aimed at"
    )
    return [table]
