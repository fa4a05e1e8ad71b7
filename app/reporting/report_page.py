"""A diagnosis as one HTML page that needs nothing but itself: to print, to keep, to send."""

from __future__ import annotations

import base64
import json
from html import escape
from pathlib import Path
from typing import Any

from palpate.app.reporting.html_document import one_file, section
from palpate.app.reporting.model_comparison import sequence_errors
from palpate.app.reporting.report_plots import error_plots
from palpate.app.reporting.report_tables import (
    cause_tables,
    control_list,
    ladder_bars,
    limit_table,
    probe_list,
    ranking_table,
    sequence_table,
    untold_list,
)
from palpate.app.reporting.sentences import (
    left_sentences,
    palpation_sentences,
    registration_sentences,
    verdict_sentence,
)
from palpate.app.storage.run_store import Run

__all__ = ["report_page"]


def report_page(run: Run) -> str:
    """The verdict first, then what it rests on: causes, gain, every sequence, evidence, rivals,
    limits, what to measure next.
    """
    report, replays = run.report, [run.replay(name) for name in run.sequences]
    size = [float(edge) for edge in replays[0].size] if replays else None
    rows, splits = sequence_errors(run), run.origin.get("splits", {})
    shown = {row.sequence: row for row in rows}
    ordered = [replay for name in shown for replay in replays if replay.name == name]
    causes = report.get("causes", [])
    parts = [
        _head(run, size),
        _if(
            "Cause" if len(causes) == 1 else "Causes", _interval_note(report), cause_tables(causes)
        ),
        _if(
            "Error on sequences not fitted on",
            _gain_note(report),
            ladder_bars(report.get("gain") or {}, bool(causes)),
        ),
        _if(
            "Every sequence",
            _KEY,
            (sequence_table(rows) + error_plots(ordered, splits)) if rows else "",
        ),
        _if(
            "The error and its explanation",
            f"As measured, and {'as the cause predicts it' if causes else 'nothing beside it, for no cause was named'}; "
            "squares are patches of the surface.",
            _image(run, "patterns"),
        ),
        _if(
            "Palpation",
            "; ".join(palpation_sentences(report)),
            _image(run, "palpation") if report.get("palpation") else "",
        ),
        _if(
            "Ranking",
            "How much of the error each cause alone removes, and how probable it is.",
            ranking_table(report),
        ),
        _if(
            "What this data can tell",
            "The smallest size of each effect that would be named.",
            limit_table(report),
        ),
        _if(
            "Controls", "The same diagnosis with motions that were not made.", control_list(report)
        ),
        _if("What to measure next", "", probe_list(report)),
        _if("Cannot be told from this data", "", untold_list(report)),
        section("How this was made", _made(run), _model(run)),
    ]
    return one_file(f"Palpate: {report.get('dataset', run.name)}", "".join(parts), "report")


_KEY = (
    "RMS distance between the measured points and the model's surface, over all frames; the gain above is of the pushes alone, "
    "without the camera's fixed pattern. "
    "<span class='key'><span><i style='background: var(--raw)'></i>raw model</span>"
    "<span><i style='background: var(--extended)'></i>extended model</span>"
    "<span><i style='background: var(--floor)'></i>noise floor</span></span>"
)


def _if(title: str, note: str, body: str) -> str:
    return section(title, note, body) if body else ""


def _head(run: Run, size: list[float] | None) -> str:
    report = run.report
    verdict = escape(str(report.get("verdict", "?")))
    warnings = "".join(f"<li>{escape(str(text))}</li>" for text in report.get("warnings", []))
    return (
        f"<p class='eyebrow'><span class='tag {verdict}'>{verdict}</span>{escape(str(report.get('dataset', run.name)))}</p>"
        f"<h1>{escape(verdict_sentence(report, size))}</h1>"
        + "".join(
            f"<p class='note'>{escape(text)}</p>"
            for text in (" ".join(left_sentences(report)), *registration_sentences(report))
            if text
        )
        + (f"<ul class='warning'>{warnings}</ul>" if warnings else "")
    )


def _interval_note(report: dict[str, Any]) -> str:
    level = report.get("interval_level")
    return f"With {100 * level:.0f} % intervals." if isinstance(level, float) else ""


def _gain_note(report: dict[str, Any]) -> str:
    gain = report.get("gain") or {}
    probes = gain.get("probes")
    return (
        f"On {probes} probes of the {escape(str(gain.get('split', 'test')))} split."
        if probes
        else ""
    )


def _image(run: Run, name: str) -> str:
    path: Path = run.path / "pictures" / f"{name}.png"
    if not path.is_file():
        return ""
    data = base64.b64encode(path.read_bytes()).decode()
    return f"<img alt='{name}' src='data:image/png;base64,{data}'>"


def _made(run: Run) -> str:
    origin, fitted = run.origin, run.model.get("fitted_on") or []
    said = [
        f"Fitted on {escape(', '.join(map(str, fitted)))}" if fitted else "",
        f"run {escape(run.name)}",
    ]
    if "seed" in origin:
        said.append(f"seed {origin['seed']}")
    if "seconds" in origin:
        said.append(f"{origin['seconds']:.0f} s")
    return "; ".join(part for part in said if part) + "."


def _model(run: Run) -> str:
    return f"<details><summary>The extended model</summary><pre>{escape(json.dumps(run.model, indent=2))}</pre></details>"
