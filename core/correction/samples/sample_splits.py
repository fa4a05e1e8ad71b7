"""Split of samples into training, validation and test, by whole sequences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from palpate.correction.samples.sample_store import Samples
from palpate.foundation.errors import CorrectionError

__all__ = ["Split"]


@dataclass(frozen=True, kw_only=True)
class Split:
    """Names of the sequences of each side.

    Frames of one sequence are similar, so no sequence may be on two sides (CorrectionError).

    Attributes:
        train: sequences that are trained on.
        validation: sequences that stop the training.
        test: sequences that are only predicted.
    """

    train: tuple[str, ...]
    validation: tuple[str, ...]
    test: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.train or not self.validation:
            missing = "validation" if self.train else "train"
            raise CorrectionError(f"no sequence for {missing}: name at least one", key=missing)
        everywhere = (*self.train, *self.validation, *self.test)
        for name in everywhere:
            if everywhere.count(name) > 1:
                raise CorrectionError(
                    f"{name} is on two sides of the split; frames of one sequence are similar",
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
        """Return the named sides, and the dataset's own for those that are not named.

        Without validation sequences, the last of several training sequences becomes one.
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
