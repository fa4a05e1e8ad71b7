"""MATLAB files as tables: each variable of equal length is one column, or several."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from palpate.foundation.errors import DatasetError
from palpate.importing.tables.table_text import TextTable

__all__ = ["STRUCT", "matlab_structs", "read_matlab"]

STRUCT = "struct"
"""Column with the number of the structure that a row is of, from 1."""
_CONSTANTS = (1, 3, 4)
"""Numbers of components of a field that holds for all rows of its structure."""
_HEADER = 128
_COMPRESSED = 15
"""Type of a compressed element; source: MAT-File Format, MathWorks."""
_BEGINNING = 4096
"""Bytes of a variable in which the name of its class stands."""


def read_matlab(path: Path) -> TextTable:
    """Read the numeric variables of a .mat file (versions 4 to 7) as one table.

    A matrix of k columns becomes NAME.1 to NAME.k, one of three NAME.x, NAME.y, NAME.z. Without
    matrices, the fields of structures are read: one row for each of the longest field of each
    structure of an array, its numbers and vectors repeated.

    Raises DatasetError for version 7.3 and for objects of MATLAB, which SciPy does not read.
    """
    found = _loaded(path)
    arrays = {name: value for name, value in found.items() if _is_numeric(name, value)}
    if not arrays:
        for _, structs in matlab_structs(found):
            table = _table_of_structs(path, structs)
            if table is not None:
                return table
        kinds = ", ".join(sorted(name for name in found if not name.startswith("__"))) or "nothing"
        raise DatasetError(
            f"{path.name} holds {kinds}, no matrix of numbers; expected numbers: save structures "
            "of numbers, or matrices",
            file=path.name,
        )
    length = max(max(value.shape) for value in arrays.values())
    columns: dict[str, list[str]] = {}
    for name, value in arrays.items():
        columns.update(_columns(name, value, length))
    return TextTable(path.name, columns, tuple(range(1, length + 1)), True)


def matlab_structs(found: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Arrays of structures by name, those within a single structure after it."""
    for name, value in found.items():
        if name.startswith("__") or not isinstance(value, np.ndarray) or not value.dtype.names:
            continue
        yield name, value.ravel()
        if value.size == 1:
            inner = value.ravel()[0]
            yield from matlab_structs({field: inner[field] for field in value.dtype.names})


def _loaded(path: Path) -> Mapping[str, Any]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    classes = _classes(path)
    if classes:
        variable, kind = classes
        plain = f"{path.stem}-plain.mat"
        raise DatasetError(
            f"{path.name}: {variable} holds objects of the MATLAB class {kind}, which are read in "
            f"MATLAB alone; expected structures: run there, with {kind}.m on its path, "
            f"c = load('{path.name}').{variable}; if ~iscell(c), c = {{c}}; end; "
            "s = cellfun(@struct, c, 'UniformOutput', false); s = [s{:}]; "
            f"save('{plain}', 's', '-v7'), and import {plain}",
            file=path.name,
        )
    try:
        found: Mapping[str, Any] = loadmat(path, squeeze_me=False)
    except NotImplementedError:
        raise DatasetError(
            f"{path.name} is of MATLAB version 7.3; expected version 7: save it with '-v7'",
            file=path.name,
        ) from None
    except (MatReadError, ValueError, TypeError, OSError, EOFError) as error:
        raise DatasetError(
            f"{path.name} cannot be read ({error}); save it with '-v7'", file=path.name
        ) from None
    return found


def _classes(path: Path) -> tuple[str, str] | None:
    """First variable that holds objects, and the name of their class; None without objects.

    SciPy fails on some such files and hides the class in others.
    """
    data = path.read_bytes()
    order: Literal["little", "big"] = "little" if data[126:128] == b"IM" else "big"
    at = _HEADER
    while at + 8 <= len(data):
        kind, size = (int.from_bytes(data[at + n : at + n + 4], order) for n in (0, 4))
        body = data[at + 8 : at + 8 + size]
        if kind == _COMPRESSED:
            try:
                body = zlib.decompressobj().decompress(body, _BEGINNING)
            except zlib.error:
                return None
        words = re.findall(rb"[A-Za-z]\w{2,}", body[:_BEGINNING])
        if b"MCOS" in words and words[0] != b"MCOS":
            after = words[words.index(b"MCOS") + 1 :]
            if after and not after[0].startswith(b"FileWrapper"):
                return words[0].decode(), after[0].decode()
        at += 8 + size
        if size == 0:
            break
    return None


def _table_of_structs(path: Path, structs: Any) -> TextTable | None:
    """One table of an array of structures; None where they hold no rows of numbers."""
    parts: list[dict[str, list[str]]] = []
    for number, one in enumerate(structs, 1):
        fields = {
            name: one[name]
            for name in structs.dtype.names
            if isinstance(one[name], np.ndarray)
            and one[name].ndim == 2
            and one[name].dtype.kind in "iufb"
            and one[name].size
        }
        length = max((max(value.shape) for value in fields.values()), default=0)
        if length < 2:
            continue
        part: dict[str, list[str]] = {}
        for name, value in fields.items():
            part.update(_columns(name, value, length))
        part[STRUCT] = [str(number)] * length
        parts.append(part)
    if not parts:
        return None
    common = [name for name in parts[0] if all(name in part for part in parts)]
    if len(common) < 2:
        return None
    columns = {name: [text for part in parts for text in part[name]] for name in common}
    if len(structs) == 1:
        columns.pop(STRUCT)
    rows = len(next(iter(columns.values())))
    return TextTable(path.name, columns, tuple(range(1, rows + 1)), True)


def _columns(name: str, value: Any, length: int) -> dict[str, list[str]]:
    """Columns of a matrix of this length, or of a constant vector; none of others."""
    matrix = value if value.shape[0] == length else value.T
    if matrix.shape[0] != length:
        if value.size not in _CONSTANTS or 1 not in value.shape:
            return {}
        matrix = np.tile(value.reshape(1, -1), (length, 1))
    labels = _labels(name, matrix.shape[1])
    return {
        label: [repr(number) for number in numbers.tolist()]
        for label, numbers in zip(labels, matrix.T, strict=True)
    }


def _is_numeric(name: str, value: object) -> bool:
    if name.startswith("__") or not isinstance(value, np.ndarray):
        return False
    return value.ndim == 2 and value.dtype.kind in "iuf" and value.size > 1


def _labels(name: str, count: int) -> list[str]:
    if count == 1:
        return [name]
    return [f"{name}.{axis}" for axis in ("xyz" if count == 3 else range(1, count + 1))]
