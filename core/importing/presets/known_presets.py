"""All presets, and the choice among them."""

from __future__ import annotations

from pathlib import Path

from palpate.foundation.errors import DatasetError
from palpate.importing.presets.poke_flex import PokeFlex
from palpate.importing.presets.preset import Preset
from palpate.importing.presets.vanderbilt_probing import VanderbiltProbing
from palpate.importing.presets.wu_network import WuNetwork

__all__ = ["NO_PRESET", "preset_of", "presets"]

NO_PRESET = "none"
"""Name by which no preset is taken."""


def presets() -> tuple[Preset, ...]:
    """All presets."""
    return (WuNetwork(), PokeFlex(), VanderbiltProbing())


def preset_of(path: Path, name: str = "") -> Preset | None:
    """The preset of a file or folder.

    Args:
        path: that a user names.
        name: of the preset; empty to go by the look, "none" for no preset.

    Raises DatasetError for a name that there is not, and where the path does not fit it.
    """
    if name == NO_PRESET:
        return None
    known = {one.name: one for one in presets()}
    if not name:
        return next((one for one in known.values() if one.fits(path)), None)
    if name not in known:
        raise DatasetError(
            f"there is no preset '{name}'; expected {', '.join(known)}, or {NO_PRESET}",
            key="preset",
            value=name,
        )
    if not known[name].fits(path):
        raise DatasetError(
            f"{path.name} is not laid out as {name} ({known[name].summary}); expected such a "
            "folder or file: name it, or leave --preset out",
            file=path.name,
            key="preset",
        )
    return known[name]
