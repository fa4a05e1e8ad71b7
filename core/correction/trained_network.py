"""A trained network, with the body that it corrects and a description, in one file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import torch

from palpate.correction.checkpoint_file import load, save
from palpate.correction.networks.architectures import CorrectionNetwork, NetworkSpec, build
from palpate.correction.samples.corrected_points import Body
from palpate.foundation.errors import RunError

__all__ = ["FILE", "TrainedNetwork"]

FILE = "network.pt"
_FORMAT = 1


@dataclass(frozen=True, eq=False)
class TrainedNetwork:
    """A network in evaluation mode.

    Attributes:
        network: the network.
        body: the points that it corrects.
        about: plain values: dataset, setup, split, training, history, and validation errors [mm]
            with and without the network.
    """

    network: CorrectionNetwork
    body: Body
    about: dict[str, Any]

    def save(self, folder: Path) -> Path:
        """Write the network to `folder` atomically; return the file."""
        arrays = {
            name: torch.as_tensor(value) if hasattr(value, "dtype") else value
            for name, value in self.body.to_arrays().items()
        }
        content = {
            "format": _FORMAT,
            "spec": self.network.spec.to_json(),
            "body": arrays,
            "about": self.about,
            "weights": {name: value.cpu() for name, value in self.network.state_dict().items()},
        }
        folder.mkdir(parents=True, exist_ok=True)
        save(folder / FILE, content)
        return folder / FILE

    @classmethod
    def load(cls, folder: Path, device: torch.device | str = "cpu") -> Self:
        """Load a network from its folder or file; RunError for none or another format."""
        path = folder if folder.suffix == ".pt" else folder / FILE
        content = load(path, device)
        if content.get("format") != _FORMAT:
            raise RunError(
                f"{path} is of format {content.get('format')}; expected {_FORMAT}: train again",
                path=str(path),
            )
        arrays = {
            name: value.numpy(force=True) if isinstance(value, torch.Tensor) else value
            for name, value in content["body"].items()
        }
        body = Body.from_arrays(arrays)
        network = build(NetworkSpec.from_json(content["spec"]), body).to(device)
        try:
            network.load_state_dict(content["weights"])
        except RuntimeError as error:
            raise RunError(
                f"{path} was trained by another version ({error}); train again", path=str(path)
            ) from None
        return cls(network.eval(), body, content["about"])
