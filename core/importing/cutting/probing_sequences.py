"""Sequences, splits and the frame of forces of recordings in steps of depth."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.importing.import_notes import ImportNotes
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping, SequenceWindow
from palpate.importing.sources.probing_source import ProbingSource

__all__ = ["with_probing"]


def with_probing(
    mapping: ImportMapping, recordings: Sequence[Recording], notes: ImportNotes
) -> ImportMapping:
    """Cut recordings of depth steps into sequences of some pushes each.

    Returns:
        the mapping with these sequences and splits, and with the frame of the forces where they
        push the tool out of the body along its normals; the same where no recording is of steps.
    """
    probed = [
        (recording.name, source)
        for recording in recordings
        for source in recording.sources
        if isinstance(source, ProbingSource)
    ]
    if not probed or len(probed) < len(recordings):
        return mapping
    windows: list[SequenceWindow] = []
    splits: dict[str, list[str]] = {"train": [], "validation": [], "test": []}
    for name, source in probed:
        prefix = "probe" if len(probed) == 1 else f"{name[:50]}-probe"
        windows += source.windows(name, prefix)
        for split, names in source.splits(prefix).items():
            splits[split] += names
        notes.decide(
            f"{source.path.name}: its pushes are spread over {len(source.windows(name, prefix))} "
            "sequences, neighbours in different ones"
        )
    notes.decisions[:] = [one for one in notes.decisions if not one.startswith("one recording:")]
    changed: dict[str, object] = {
        "cutting": mapping.cutting.model_copy(update={"cut": False}),
        "sequences": tuple(windows),
        "setup": {"splits": splits, **mapping.setup},
    }
    signs = {source.force_sign() for _, source in probed}
    if mapping.wrench.frame == "" and len(signs) == 1 and 0 not in signs:
        sign = signs.pop()
        way = "out of" if sign > 0 else "into"
        notes.decide(
            f"forces: their changes push the tool {way} the body along its normals, so that they "
            f"are in the robot frame, sign {sign}"
        )
        notes.warnings[:] = [one for one in notes.warnings if "state [wrench] frame" not in one]
        frame = {"frame": "robot", "sign": sign}
        changed["wrench"] = mapping.wrench.model_copy(update=frame)
    return mapping.model_copy(update=changed)
