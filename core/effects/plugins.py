"""Effects of other packages: found by the entry point `palpate.effects`, and checked."""

from __future__ import annotations

import inspect
import math
import warnings
from collections.abc import Iterable
from dataclasses import is_dataclass
from importlib.metadata import EntryPoint, entry_points

from palpate.effects.base import Effect, Slot
from palpate.effects.linearisation import Linearisation
from palpate.effects.parameter import Parameter
from palpate.foundation.errors import EffectError

__all__ = ["GROUP", "checked", "outside_effects"]

GROUP = "palpate.effects"
_OLD_NAMES = ("core", "app")
"""Import names of Palpate's folders before they were installed as `palpate`."""


def outside_effects(
    known: Iterable[str], points: Iterable[EntryPoint] | None = None
) -> tuple[type[Effect], ...]:
    """Return the effects of installed packages, in the order of their entry points' names.

    An effect that cannot be loaded or breaks the contract is left out with a warning that says
    which and why, so that one broken package does not take the catalogue away.

    Args:
        known: names that are taken.
        points: entry points; those of the installed packages without it.
    """
    taken, found = set(known), list[type[Effect]]()
    for point in sorted(
        entry_points(group=GROUP) if points is None else points, key=lambda one: one.name
    ):
        try:
            effect = checked(point.load(), taken)
        except Exception as error:  # a module of another package may raise anything on import
            reason = _reason(error)
            warnings.warn(
                f"the effect {point.name} = {point.value} is left out: {reason}", stacklevel=2
            )
            continue
        taken.add(effect.name)
        found.append(effect)
    return tuple(found)


def _reason(error: Exception) -> str:
    """Describe the error; for an import by the old names, say what to write."""
    if isinstance(error, EffectError):
        return error.message
    reason = f"{type(error).__name__}: {error}"
    if isinstance(error, ImportError) and (error.name or "").partition(".")[0] in _OLD_NAMES:
        reason += (
            "; Palpate is imported as 'palpate': write 'from palpate.effects import Effect' in "
            "place of 'from core.effects import Effect'"
        )
    return reason


def checked(effect: object, taken: Iterable[str]) -> type[Effect]:
    """Return the same class if it keeps the contract of effects; raise EffectError otherwise."""
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        raise EffectError(f"{effect!r} is no subclass of palpate.effects.Effect")
    if inspect.isabstract(effect):
        raise EffectError(
            f"{effect.__name__} lacks {', '.join(sorted(effect.__abstractmethods__))}"
        )
    for name, kind in (("name", str), ("enters", Slot), ("summary", str)):
        if not isinstance(getattr(effect, name, None), kind) or not getattr(effect, name):
            raise EffectError(f"{effect.__name__} has no {name} ({kind.__name__})")
    if effect.name in taken:
        raise EffectError(f"the name {effect.name!r} is taken already")
    if effect.enters is Slot.GEOMETRY:
        raise EffectError(
            f"{effect.name} changes the geometry, which a diagnosis cannot compare yet"
        )
    if not (is_dataclass(effect) and effect.__dataclass_params__.frozen):  # type: ignore[attr-defined]  # typeshed has no such field
        raise EffectError(f"{effect.__name__} is no frozen dataclass")
    if not effect.numbers():
        raise EffectError(f"{effect.name} has no parameter that is a number")
    for item in effect.numbers():
        _check_number(effect.name, item)
    _check_linearisation(effect)
    return effect


def _check_linearisation(effect: type[Effect]) -> None:
    """Raise EffectError where what a diagnosis reads of an effect contradicts itself."""
    if not isinstance(effect.linearisation, Linearisation):
        raise EffectError(f"{effect.name} has no linearisation (Linearisation)")
    if effect.amplitude and effect.amplitude not in {item.name for item in effect.numbers()}:
        raise EffectError(f"{effect.name}: the amplitude {effect.amplitude!r} is no number of it")
    shares = effect.linearisation is Linearisation.NUISANCE
    if shares != (effect.nuisance is not None):
        raise EffectError(f"{effect.name}: the linearisation NUISANCE and a nuisance go together")
    if effect.nuisance is not None and len(effect.numbers()) != effect.nuisance.size:
        raise EffectError(
            f"{effect.name} has {len(effect.numbers())} numbers, and the nuisance "
            f"{effect.nuisance.value} has {effect.nuisance.size}"
        )
    if effect.linearisation is Linearisation.LOCAL_STIFFNESS and not effect.amplitude:
        raise EffectError(f"{effect.name} has no amplitude, which LOCAL_STIFFNESS needs")


def _check_number(name: str, item: Parameter) -> None:
    if not item.unit:
        raise EffectError(
            f"{name}: {item.name} has no unit; a pure number has the unit 1", parameter=item.name
        )
    if not (math.isfinite(item.low) and math.isfinite(item.high) and item.low < item.high):
        raise EffectError(
            f"{name}: {item.name} is bounded by {item.low:g} and {item.high:g}", parameter=item.name
        )
    if item.log and item.low <= 0:
        raise EffectError(
            f"{name}: {item.name} is searched by its logarithm and may be {item.low:g}",
            parameter=item.name,
        )
    if item.periodic and (item.log or item.contrast):
        raise EffectError(
            f"{name}: {item.name} comes round and is searched by a logarithm or contrast",
            parameter=item.name,
        )
    if item.contrast and (item.log or item.low < 0):
        what = "by its logarithm, too" if item.log else f"and may be {item.low:g}"
        raise EffectError(
            f"{name}: {item.name} is searched as a ratio's contrast {what}", parameter=item.name
        )
    span = item.coordinate(item.high) - item.coordinate(item.low)
    if not 0 < item.scale < span:
        raise EffectError(
            f"{name}: the scale of {item.name} is {item.scale:g}, not between 0 and {span:g}",
            parameter=item.name,
        )
