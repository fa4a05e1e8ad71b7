"""Which samples are trained on, which stop the training, and which are only predicted: whole
sequences, never single frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from palpate.correction.samples.sample_store import Samples
from palpate.foundation.errors import CorrectionError

__all__ = ["Split"]


@dataclass(frozen=True, kw_only=True)
class Split:
    """Names of sequences; frames of one sequence are alike, so that none may be on two sides."""

    train: tuple[str, ...]
    validation: tuple[str, ...]
    test: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.train or not self.validation:
            lacking = "validation" if self.train else "train"
            raise CorrectionError(f"no sequence for {lacking}: name at least one", key=lacking)
        everywhere = (*self.train, *self.validation, *self.test)
        for name in everywhere:
            if everywhere.count(name) > 1:
                raise CorrectionError(
                    f"{name} is on two sides of the split; frames of one sequence are alike",
                    key="split",
                    value=name,
                )

    @classmethod
    def of(
        cls,
        samples: Samples,
        *,
        train: Sequence[str] = (),
        validation: Sequence[str] = (),
        test: Sequence[str] = (),
    ) -> Self:
        """The sides that are named, and of the others those stated by the dataset.

        Where the dataset states no validation, the last of several training sequences is it.
        """
        stated = samples.about["splits"]
        names = {
            "train": tuple(train or stated["train"]),
            "validation": tuple(validation or stated["validation"]),
        }
        if not names["validation"] and len(names["train"]) > 1:
            names = {"train": names["train"][:-1], "validation": names["train"][-1:]}
        split = cls(**names, test=tuple(test or stated["test"]))
        samples.rows((*split.train, *split.validation, *split.test))
        return split
