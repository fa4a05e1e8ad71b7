"""The specification of a training, as plain values for REST, command line and checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self, get_args

from palpate.correction.networks.architectures import NetworkSpec
from palpate.correction.networks.chamfer import Distance
from palpate.foundation.errors import CorrectionError

__all__ = ["TrainingSpec"]

_BOUNDS: Mapping[str, tuple[float, float]] = {
    "rate": (1e-7, 1.0),
    "batch": (1, 4096),
    "epochs": (1, 100_000),
    "patience": (1, 100_000),
    "hold": (0, 1e6),
    "keep_every": (1, 10**9),
}


@dataclass(frozen=True, kw_only=True)
class TrainingSpec:
    """The specification of one training.

    Attributes:
        network: the network that is trained.
        distance: distance of the loss, see `palpate.correction.networks.chamfer`.
        hold: weight of the hidden points' correction [1/mm].
        rate: learning rate of Adam, halved after `patience` / 2 epochs without improvement.
        batch: samples per step.
        epochs: most epochs.
        patience: epochs without a lower validation error after which the training ends.
        keep_every: steps between checkpoints.
        mixed: whether convolutions use half precision, on CUDA only.
        device: torch device, or "auto".
        threads: number of CPU threads; torch's own choice if None.
        seed: seed of the first weights and of the order of the samples.
    """

    network: NetworkSpec = field(default_factory=NetworkSpec)
    distance: Distance = "chamfer"
    hold: float = 0.1
    rate: float = 5e-4
    batch: int = 64
    epochs: int = 40
    patience: int = 6
    keep_every: int = 200
    mixed: bool = True
    device: str = "auto"
    threads: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.distance not in get_args(Distance):
            raise CorrectionError(
                f"distance = {self.distance!r}; expected one of {', '.join(get_args(Distance))}",
                key="distance",
            )
        for key, (low, high) in _BOUNDS.items():
            value = getattr(self, key)
            if not low <= value <= high:
                raise CorrectionError(
                    f"{key} = {value:g}; expected {low:g} to {high:g}",
                    key=key,
                    value=value,
                    low=low,
                    high=high,
                )
        if self.threads is not None and not 1 <= self.threads <= 1024:
            raise CorrectionError(
                f"threads = {self.threads}; expected 1 to 1024", key="threads", value=self.threads
            )

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "network": self.network.to_json()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the specification that `to_json` wrote; missing keys have their defaults."""
        network = NetworkSpec.from_json(data["network"]) if "network" in data else NetworkSpec()
        return cls(**{**data, "network": network})
