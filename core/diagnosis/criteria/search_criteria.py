"""Thresholds of the search: screening, naming a cause, rivals, and paired touches."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.diagnosis.criteria.threshold import threshold

__all__ = ["InclusionGridCriteria", "NamingCriteria", "ScreeningCriteria", "TouchPairingCriteria"]


@dataclass(frozen=True, kw_only=True)
class NamingCriteria:
    """Bounds for naming a cause, and rivals beside it."""

    least_gain: float = threshold(
        25.0,
        "nat",
        "Smallest gain of a named cause, whatever the null distribution allows.",
        "measured: of twenty controls of the virtual bench one offered 23, a weak lump of half the "
        "block's width such as the grid's own error looks like, and no other more than 10; the "
        "smallest gain of a hidden cause of clear size was 28, a lump that few pushes came near",
    )
    least_confirmed_gain: float = threshold(
        12.0,
        "nat",
        "Smallest gain on the fitted sequences of a cause that test sequences confirm, whatever "
        "its own null distribution allows. Both gains together must be `least_gain`.",
        "measured: the best of the catalogue gained at most 8 on each of fifty controls of the "
        "virtual bench (seed 1400)",
    )
    null_draws: int = threshold(400, "1", "Draws of the best gain in the catalogue by chance.")
    null_quantile: float = threshold(
        0.99,
        "1",
        "Quantile of the best gain by chance that a cause must exceed.",
        "measured: in a linear trial with nothing hidden this bound named a cause in 0 of 150 "
        "data sets, two standard errors of the gain in 2.5 %, BIC in 96 %",
    )
    null_tail: float = threshold(
        0.1, "1", "Share of an effect's gains by chance from which their tail is estimated."
    )
    rival: float = threshold(
        8.0,
        "nat",
        "Rivals whose gain is within this of the best are named too.",
        "derived: the difference of two log densities that differ by d has a spread of about "
        "sqrt(2 d), so 8 nats are two of its standard deviations",
    )
    most_left: float = threshold(
        0.9,
        "1",
        "Largest share of the misfit above noise that counts as left where laws of one family are "
        "compared.",
    )
    most_causes: int = threshold(3, "1", "Largest number of causes of one model.")
    promising: float = threshold(
        0.5,
        "1",
        "Share of the bound that a cause must reach in the linear screening to be refitted; its "
        "refit may gain more.",
    )
    second_factor: float = threshold(
        2.0,
        "1",
        "A second cause must gain this many times the bound of the first.",
        "derived: the mesh's error is known for the stated setup, and a first cause changes it",
    )
    second_share: float = threshold(
        0.1,
        "1",
        "A second cause must gain this share of the first one's gain, unless it removes most of "
        "what the first leaves.",
        "measured: on top of the only cause, of 84 to 14 780 nats, the best of the catalogue gains "
        "at most 40",
    )
    second_left: float = threshold(
        0.5,
        "1",
        "Largest share of the first cause's misfit above noise, or of its significant structure "
        "beyond chance, that a second one leaves if it counts as removing most of it.",
        "measured: of 20 pairs of the virtual bench (seed 1400) whose first cause leaves misfit "
        "above noise, the second one leaves more in one",
    )
    hopeless: float = threshold(
        60.0,
        "nat",
        "A candidate this far behind the best one after two steps of its fit, or behind the model "
        "without it, is given up.",
    )
    unsettled: float = threshold(
        0.5,
        "1",
        "Share of the best gain from which a cause beside one with history is fitted to its end.",
        "measured: such a fit gained 1100 nats besides the 2300 that it had before its end",
    )
    history_optimism: float = threshold(
        2.0,
        "1",
        "A history-dependent candidate is skipped where this many times its linear gain would "
        "still leave it hopelessly behind.",
    )
    most_rivals: int = threshold(
        2, "1", "Largest number of causes that are tried in place of one that was found."
    )
    most_pairs: int = threshold(
        2, "1", "Largest number of pairs of causes that are fitted at once."
    )
    probability_temperature: float = threshold(
        4.0,
        "1",
        "Gains are divided by this before they become probabilities.",
        "reference: predictive densities of a model that is not true are over-sure (Yang and Zhu "
        "2018); the value is chosen",
    )


@dataclass(frozen=True, kw_only=True)
class ScreeningCriteria:
    """Candidates of the linear screening, and where their refits start."""

    shortlist: int = threshold(
        3, "1", "Largest number of effects that are refitted for their linear gain."
    )
    strained: float = threshold(
        4.0,
        "1",
        "A cause that widens a stated accuracy is refitted whatever its linear gain, if the data "
        "pull its parameters as improbably as one by this many standard deviations.",
        "derived: to first order the nuisance explains most of it already, and hides the rest",
    )
    search_over_baseline: float = threshold(
        6.0,
        "1",
        "Expected duration of a search over that of the first replay on two meshes.",
        "measured: 4 with nothing hidden, 5 with a lump (seed 467766 of the demo); a material that "
        "remembers takes several times as long",
    )
    inclusions_apart: float = threshold(
        0.015, "m", "Two starts of an inclusion are refitted if they are farther apart than this."
    )
    other_shapes: float = threshold(
        0.5,
        "1",
        "Share of the best gain from which other shapes are tried where a ball was fitted.",
    )
    least_share: float = threshold(
        0.2, "1", "Smallest share of a finite effect with which a refit starts."
    )
    most_share: float = threshold(
        4.0, "1", "Largest multiple of a finite effect with which a refit starts."
    )
    farthest_log: float = threshold(
        1.8, "1", "Largest change of a logarithm with which a refit starts."
    )
    farthest_contrast: float = threshold(
        0.7,
        "1",
        "Largest change of a stiffness contrast with which a refit starts: 6.8 times as stiff.",
    )


@dataclass(frozen=True, kw_only=True)
class InclusionGridCriteria:
    """Places and size of inclusions that are tried below the pushes."""

    radius: float = threshold(7e-3, "m", "Radius of the inclusions that are tried.")
    stiffness_ratio: float = threshold(5.0, "1", "Their stiffness over the body's.")
    depths: tuple[float, ...] = threshold(
        (9e-3, 14e-3),
        "m",
        "Depths of their centres below the surface.",
        "derived: a push of some millimetres hardly shows what lies deeper",
    )
    spacing: float = threshold(7e-3, "m", "Pushes nearer to one another than this share places.")


@dataclass(frozen=True, kw_only=True)
class TouchPairingCriteria:
    """Touches that were paired with other landmarks."""

    scale_deviation: float = threshold(
        0.08,
        "1",
        "Prior deviation of the size of the touched body over the stated one.",
        "derived: four steps that matter, as for any parameter",
    )
    inset_deviation: float = threshold(
        2e-3,
        "m",
        "Prior deviation of how far inside its corners the body was touched.",
        "derived: four steps that matter, as for any parameter",
    )
    rounds: int = threshold(8, "1", "Largest number of Gauss-Newton steps.")
    scale_step: float = threshold(1e-4, "1", "Step of the derivative by the scale.")
    inset_step: float = threshold(1e-6, "m", "Step of the derivative by the inset.")
    settled: float = threshold(
        1e-3, "1", "The fit ends with a step below this, in prior deviations."
    )
