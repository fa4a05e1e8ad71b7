"""MATLAB files as tables: each variable of equal length is one column, or several."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.foundation.errors import DatasetError
from palpate.importing.tables.table_text import TextTable

__all__ = ["read_matlab"]


def read_matlab(path: Path) -> TextTable:
    """Read the numeric variables of a .mat file (versions 4 to 7) as one table.

    A matrix of k columns becomes NAME.1 to NAME.k, one of three NAME.x, NAME.y, NAME.z.

    Raises DatasetError for version 7.3 and for objects of MATLAB, which SciPy does not read.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        found = loadmat(path, squeeze_me=False)
    except NotImplementedError:
        raise DatasetError(
            f"{path.name} is of MATLAB version 7.3; expected version 7: save it with '-v7'",
            file=path.name,
        ) from None
    except (MatReadError, ValueError, TypeError, OSError, EOFError) as error:
        raise DatasetError(
            f"{path.name} cannot be read ({error}); save it with '-v7'", file=path.name
        ) from None
    arrays = {name: value for name, value in found.items() if _is_numeric(name, value)}
    if not arrays:
        kinds = ", ".join(sorted(name for name in found if not name.startswith("__"))) or "nothing"
        raise DatasetError(
            f"{path.name} holds {kinds}, no matrix of numbers; expected numbers: save structures "
            "and objects of MATLAB as matrices",
            file=path.name,
        )
    length = max(max(value.shape) for value in arrays.values())
    columns: dict[str, list[str]] = {}
    for name, value in arrays.items():
        matrix = value if value.shape[0] == length else value.T
        if matrix.shape[0] == length:
            labels = _labels(name, matrix.shape[1])
            for label, numbers in zip(labels, matrix.T, strict=True):
                columns[label] = [repr(number) for number in numbers.tolist()]
    return TextTable(path.name, columns, tuple(range(1, length + 1)), True)


def _is_numeric(name: str, value: object) -> bool:
    if name.startswith("__") or not isinstance(value, np.ndarray):
        return False
    return value.ndim == 2 and value.dtype.kind in "iuf" and value.size > 1


def _labels(name: str, count: int) -> list[str]:
    if count == 1:
        return [name]
    return [f"{name}.{axis}" for axis in ("xyz" if count == 3 else range(1, count + 1))]
