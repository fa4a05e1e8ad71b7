"""Time and memory of a diagnosis with the whole catalogue on a large dataset."""

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
"""A single drag is shorter than the required 20 s."""
SCENARIO = Scenario(effects=(HIDDEN,), sequences=SEQUENCES, rounds=ROUNDS, density=8000, rate=30.0)
SEED, WORKERS = 11, 2
MOST_TIME, MOST_MEMORY = 300.0, 3e9
"""Targets for a diagnosis of six sequences of 20 s: wall time [s] and memory [bytes]."""
_NEAR_PEAK = 0.98
"""Share of the largest sum of resident sizes, above which shared pages are counted [1]."""
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
"""Step by the first words of the progress text of a diagnosis; the first match counts."""


class Steps:
    """Measures wall time by step of a diagnosis, from its progress texts.

    Args:
        clock: returns the time [s].
    """

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
    """Context manager that measures the peak memory of this process and its children [bytes].

    Shared pages are counted once. Measured: this takes the kernel 15 ms a process, in which the
    process waits; twice a second it would take 25 of the 527 CPU seconds of a diagnosis. It is done
    only while the sum of resident sizes, which is cheap, is near its peak.

    Args:
        interval: time between measurements [s].
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
            if now > _NEAR_PEAK * highest:
                highest = max(now, highest)
                self.most = max(self.most, sum(_proportional(process) for process in family))
            if self._stop.wait(self._interval):
                return


def _family(root: int) -> list[int]:
    """Return a process and all its descendants."""
    family = [root]
    for process in family:
        for thread in Path(f"/proc/{process}/task").glob("*/children"):
            family += [int(child) for child in _text(thread).split()]
    return family


def _resident(process: int) -> float:
    """Return the resident set size [bytes], shared pages included; 0 for an ended process."""
    return float(
        resource.getpagesize() * int((_text(Path(f"/proc/{process}/statm")) or "0 0").split()[1])
    )


def _proportional(process: int) -> float:
    """Return the proportional set size [bytes]; 0 for an ended process."""
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
    mean = sum(seconds) / len(names)
    return f"{len(names)} sequences of {mean:.0f} s, {sum(clouds)} clouds of about {points} points"


def run() -> list[Table]:
    """Make and diagnose the dataset; RuntimeError where the hidden cause is not found."""
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
            f"{HIDDEN.effect} is hidden, but {', '.join(named) or report['verdict']} was found"
        )
    processor = sum(
        getattr(after, name) - getattr(before, name)
        for name in ("user", "system", "children_user", "children_system")
    )
    table = Table("step", "time", "share", title=f"Diagnosis of {size}, {WORKERS} processes")
    for name, seconds in steps.seconds.items():
        table.add_row(name, f"{seconds:.0f} s", f"{100 * seconds / spent:.0f} %")
    table.add_section()
    table.add_row("total wall time", f"{spent:.0f} s", f"target: at most {MOST_TIME:.0f} s")
    table.add_row(
        "total CPU time",
        f"{processor:.0f} s",
        f"{processor / WORKERS:.0f} s on {WORKERS} idle cores",
    )
    table.add_row(
        "memory", f"{watch.most / 1e9:.2f} GB", f"target: at most {MOST_MEMORY / 1e9:.0f} GB"
    )
    return [table]
