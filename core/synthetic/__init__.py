"""The virtual bench: datasets with known hidden effects, made through another mesh, element and law than the replay's."""

from core.synthetic.making import make_dataset
from core.synthetic.scenario import HIDDEN, SHORT_PROTOCOL, WEIGHED, HiddenEffect, Scenario, draw_scenario
from core.synthetic.truth import Truth, truth_path

__all__ = [
    "HIDDEN", "SHORT_PROTOCOL", "WEIGHED", "HiddenEffect", "Scenario", "Truth", "draw_scenario", "make_dataset", "truth_path",
]  # fmt: skip
