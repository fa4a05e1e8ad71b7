"""Results as plain JSON values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from palpate.dataset import Dataset

__all__ = ["dataset_summary", "finite"]


def finite(values: Any, digits: int = 8) -> Any:
    """Numbers as nested lists, rounded; None for those that are not finite."""
    array = np.round(np.asarray(values, dtype=float), digits)
    if array.ndim == 0:
        return float(array) if np.isfinite(array) else None
    if np.isfinite(array).all():
        return array.tolist()
    return [finite(part, digits) for part in array]


def dataset_summary(dataset: Dataset) -> dict[str, Any]:
    """Content of a dataset, SI units."""
    config = dataset.config
    splits = {"train": config.train, "validation": config.validation, "test": config.test}
    return {
        "folder": dataset.path.name,
        "name": dataset.name,
        "size": list(config.size),
        "mass": config.mass,
        "tool_radius": config.tool_radius,
        "touches": len(dataset.touches.names),
        "has_rest": dataset.has_rest,
        "sequences": [
            {
                "name": name,
                "clouds": len(dataset.sequence(name)),
                "split": next((split for split, names in splits.items() if name in names), None),
            }
            for name in dataset.sequences
        ],
    }
