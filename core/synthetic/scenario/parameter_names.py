"""What the virtual bench can do wrong is called by name, with parameters by name, and nothing else
is taken.
"""

from __future__ import annotations

from collections.abc import Mapping

from palpate.foundation.errors import EffectError

__all__ = ["check_named"]


def check_named(
    name: str, parameters: Mapping[str, object], known: Mapping[str, Mapping[str, str]], verb: str
) -> None:
    """EffectError unless `known` has this name with exactly these parameters; `verb` says what the
    bench does with it.
    """
    if name not in known:
        raise EffectError(
            f"the virtual bench cannot {verb} {name!r}; it knows {', '.join(known)}", effect=name
        )
    if set(parameters) != set(known[name]):
        wanted, got = ", ".join(known[name]), ", ".join(parameters) or "none"
        raise EffectError(f"{name} needs the parameters {wanted}, got {got}", effect=name)
