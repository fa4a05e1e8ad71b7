"""A diagnosis as one self-contained HTML page: to print, to keep, to send."""

from __future__ import annotations

import base64
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from palpate.app.reporting.html_page import render_page
from palpate.app.reporting.model_comparison import sequence_errors
from palpate.app.reporting.report_plots import error_plots
from palpate.app.reporting.report_tables import (
    ladder_steps,
    limit_table,
    named_causes,
    ranking_note,
    ranking_table,
    removed_share,
    sequence_table,
    unidentifiable_texts,
)
from palpate.app.reporting.sentences import (
    control_sentences,
    left_sentences,
    palpation_sentences,
    probe_sentence,
    registration_sentences,
    verdict_sentence,
)
from palpate.app.reporting.stiffness_sentences import stiffness_sentences
from palpate.app.storage.run_store import Run

__all__ = ["report_page"]


def report_page(run: Run) -> str:
    """The report of a run as HTML: the verdict first, then the results that support it."""
    report, replays = run.report, [run.replay(name) for name in run.sequences]
    size = [float(edge) for edge in replays[0].size] if replays else None
    rows, splits = sequence_errors(run), run.origin.get("splits", {})
    by_name = {replay.name: replay for replay in replays}
    ordered = [by_name[row.sequence] for row in rows]
    causes, gain = report.get("causes", []), report.get("gain") or {}
    dataset = str(report.get("dataset", run.name))
    notes = (" ".join(left_sentences(report)), *registration_sentences(report))
    return render_page(
        "report.html",
        "report",
        title=f"Palpate: {dataset}",
        dataset=dataset,
        verdict=str(report.get("verdict", "?")),
        sentence=verdict_sentence(report, size),
        notes=[note for note in notes if note],
        warnings=[str(text) for text in report.get("warnings", [])],
        causes=named_causes(causes),
        interval_note=_interval_note(report),
        gain_note=_gain_note(gain),
        ladder=ladder_steps(gain, bool(causes)),
        removed=removed_share(gain, bool(causes)),
        sequences=sequence_table(rows),
        error_plots=error_plots(ordered, splits),
        patterns=_image(run, "patterns"),
        patterns_note=_patterns_note(bool(causes)),
        palpation=_image(run, "palpation") if report.get("palpation") else "",
        palpation_note="; ".join(palpation_sentences(report)),
        stiffness=stiffness_sentences(report),
        stiffness_picture=_image(run, "stiffness"),
        ranking=ranking_table(report),
        ranking_note=ranking_note(report),
        limits=limit_table(report),
        controls=control_sentences(report.get("controls") or []),
        probes=[probe_sentence(row) for row in report.get("next_probe") or []],
        unidentifiable=unidentifiable_texts(report),
        provenance=_provenance(run),
        model=json.dumps(run.model, indent=2),
    )


def _interval_note(report: dict[str, Any]) -> str:
    level = report.get("interval_level")
    return f"With {100 * level:.0f} % intervals." if isinstance(level, float) else ""


def _gain_note(gain: dict[str, Any]) -> str:
    probes = gain.get("probes")
    return f"On {probes} probes of the {gain.get('split', 'test')} split." if probes else ""


def _patterns_note(named: bool) -> str:
    beside = "as the cause predicts it" if named else "nothing beside it, for no cause was named"
    return f"As measured, and {beside}; squares are patches of the surface."


def _image(run: Run, name: str) -> str:
    """A picture of the run as a data URI; empty where there is none."""
    path: Path = run.path / "pictures" / f"{name}.png"
    if not path.is_file():
        return ""
    return f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}"


def _provenance(run: Run) -> str:
    origin, fitted = run.origin, run.model.get("fitted_on") or []
    parts = [f"Fitted on {', '.join(map(str, fitted))}"] if fitted else []
    parts.append(f"run {run.name}")
    if "created" in origin:
        made_at = datetime.fromtimestamp(float(origin["created"]), UTC)
        parts.append(f"{made_at:%Y-%m-%d %H:%M} UTC")
    if "seed" in origin:
        parts.append(f"seed {origin['seed']}")
    if "seconds" in origin:
        parts.append(f"{origin['seconds']:.0f} s")
    if made := origin.get("made_from"):
        parts.append(f"data {made['data']}")
        parts.append(f"Palpate {made['version']}, commit {made['commit'] or 'unknown'}")
    return "; ".join(parts) + "."
