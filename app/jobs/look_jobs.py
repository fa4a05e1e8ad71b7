"""Jobs of looks: take one, and import the recordings of one."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
from pathlib import Path
from typing import Any

from palpate.app.http_errors import Missing
from palpate.app.storage.dataset_import import STAGING, check_name, note_placing, was_placed
from palpate.app.storage.held_folder import held_folder
from palpate.app.storage.look_store import FILES, LookStore, placed
from palpate.foundation.errors import DatasetError
from palpate.foundation.processes import TimeUsedError, limited_memory, limited_time
from palpate.foundation.progress import Report, part

__all__ = ["import_look", "look"]

SETUP = "dataset.toml"
_MEMORY, _TIME = 2**31, 6 * 3600
"""Address space [bytes] and processor time [s] that reading recordings may take."""


def look(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Look at `request["files"]`, places on this machine, or at the folder `request["dataset"]`.

    The look has the name of the scratch folder. Uploaded files are linked into it, so that it can
    be imported later. A repeated job whose first attempt was interrupted after its look was in
    place returns that look.
    """
    scratch = Path(request["scratch"])
    store = LookStore(Path(request["runs"]))
    if store.has_begun(scratch.name):
        return {"look": scratch.name}
    made = scratch / scratch.name
    (made / FILES).mkdir(parents=True)
    with _bounded(request):
        _take(request, made, report)
    store.folder.mkdir(parents=True, exist_ok=True)
    os.rename(made, store.folder / scratch.name)
    return {"look": scratch.name}


def _take(request: dict[str, Any], made: Path, report: Report) -> None:
    from palpate.first_look.first_look import take_look
    from palpate.first_look.look_request import LookRequest

    files = [Path(file) for file in request["files"]]
    if request.get("dataset"):
        files = [Path(request["dataset"])]
    most = int(request["most"])
    uploads = {Path(one) for one in request.get("uploads", ())}
    places = tuple(
        placed(file, made / FILES, most, part(report, 0.0, 0.1)) if file in uploads else file
        for file in files
    )
    found = take_look(
        LookRequest(
            files=places,
            setup=_setup(request, made / FILES),
            mapping=_text(request.get("mapping"), made / "import.toml"),
            streams=dict(request.get("streams") or {}),
            name=str(request["name"]),
            base=made,
        ),
        made,
        part(report, 0.1 if uploads else 0.0, 1.0),
    )
    source = {
        **found["source"],
        "recordings": len(found["recordings"]),
        "setup_stated": found["setup_stated"],
        "warnings": len(found["warnings"]),
        "request": request["sent"],
    }
    (made / "source.json").write_text(json.dumps(source, ensure_ascii=False), encoding="utf-8")


def _setup(request: dict[str, Any], folder: Path) -> Path | None:
    """Write the setup that was sent, or that of a dataset, into a folder; None without one."""
    from palpate.importing.output.stated_setup import copied_setup

    if request.get("setup_from"):
        return copied_setup(Path(request["setup_from"]), folder)
    return _text(request.get("setup"), folder / SETUP)


def _text(text: str | None, place: Path) -> Path | None:
    """Write a text that was sent; None without one. A linked upload of this name stays as it is."""
    if text is None:
        return None
    place.unlink(missing_ok=True)
    place.write_text(text, encoding="utf-8")
    return place


def import_look(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Make the dataset `request["name"]` of the recordings of `request["look"]`, by its mapping or
    an edited one, with edited sequences where there are some.
    """
    datasets, name = Path(request["datasets"]), str(request["name"])
    scratch = Path(request["scratch"])
    note = datasets / STAGING / f"{scratch.name}.placed"
    if not was_placed(note, datasets / name):
        check_name(name, datasets)
        with held_folder(datasets / STAGING / scratch.name) as aside, _bounded(request):
            _import(request, scratch, aside / name, report)
            check_name(name, datasets)
            note_placing(note, aside / name)
            os.rename(aside / name, datasets / name)
    return _result(datasets / name)


def _import(request: dict[str, Any], scratch: Path, whole: Path, report: Report) -> None:
    """Import into the folder `whole`."""
    from palpate.first_look.look_request import bound_mapping
    from palpate.importing.import_notes import ImportNotes
    from palpate.importing.import_recording import import_recordings
    from palpate.importing.mapping_file import read_mapping
    from palpate.importing.rules import SequenceWindow

    files = LookStore(Path(request["runs"])).files(request["look"])
    found = files.look()
    written = _text(request.get("mapping") or found["mapping"], scratch / "import.toml")
    if written is None:
        raise DatasetError("this is the look of a dataset, which needs no import", key="look")
    sources = [files.folder / one for one in found["source"]["files"]]
    if gone := [one.name for one in sources if not one.exists()]:
        raise Missing(f"{', '.join(gone)} is no longer there: look at the recordings again")
    if (stated := files.folder / FILES / SETUP).exists():
        sources.append(stated)
    mapping = bound_mapping(read_mapping(written), sources, files.folder)
    changes: dict[str, Any] = {"name": whole.name}
    if request.get("sequences") is not None:
        changes["sequences"] = tuple(
            SequenceWindow.model_validate(one) for one in request["sequences"]
        )
    mapping = mapping.model_copy(update=changes)
    import_recordings(mapping, files.folder, whole, ImportNotes(), report)


@contextlib.contextmanager
def _bounded(request: dict[str, Any]) -> Any:
    """Bound memory and time of the block; DatasetError where they do not suffice."""
    # Its check of a surface needs a library that maps more address space than the limit.
    importlib.import_module("open3d")
    importlib.import_module("palpate.first_look.first_look")
    try:
        with limited_time(_TIME), limited_memory(_MEMORY):
            yield
    except (MemoryError, TimeUsedError) as error:
        what = (
            f"more than {_MEMORY // 2**30} GiB of memory"
            if isinstance(error, MemoryError)
            else f"more than {_TIME // 3600} hours of processor time"
        )
        raise DatasetError(
            f"these recordings take {what} to read: record shorter ones, or fewer streams"
        ) from None


def _result(folder: Path) -> dict[str, Any]:
    """Result of an import whose dataset is in place."""
    from palpate.dataset import open_dataset
    from palpate.importing.output.written_dataset import IMPORTED

    opened = open_dataset(folder)
    noted = json.loads((folder / IMPORTED).read_text(encoding="utf-8"))
    return {
        "dataset": folder.name,
        "sequences": len(opened.sequences),
        "clouds": sum(map(len, opened.loaded)),
        "warnings": noted["warnings"],
    }
