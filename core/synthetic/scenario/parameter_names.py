"""Check of the names of hidden effects and disturbances, and of their parameters."""

from __future__ import annotations

from collections.abc import Mapping

from palpate.foundation.errors import EffectError

__all__ = ["check_named"]


def check_named(
    name: str, parameters: Mapping[str, object], known: Mapping[str, Mapping[str, str]], verb: str
) -> None:
    """Raise EffectError unless `known` has this name with exactly these parameters.

    Args:
        name: of an effect or a disturbance.
        parameters: by name.
        known: names and units of the parameters of each name.
        verb: what the bench does with it, for the message.
    """
    if name not in known:
        raise EffectError(
            f"the virtual bench cannot {verb} {name!r}; it knows {', '.join(known)}", effect=name
        )
    if set(parameters) != set(known[name]):
        expected, given = ", ".join(known[name]), ", ".join(parameters) or "none"
        raise EffectError(f"{name} needs the parameters {expected}, got {given}", effect=name)
