"""The virtual bench: datasets with known hidden effects, made through another mesh, element and law than the replay's."""

from core.synthetic.disturbance import DISTURBANCES, Disturbance, draw_disturbance
from core.synthetic.making import make_dataset
from core.synthetic.scenario import HIDDEN, REMEMBERED, SHORT_PROTOCOL, STILL, WEIGHED, HiddenEffect, Scenario, draw_scenario
from core.synthetic.truth import Truth, truth_path

__all__ = [
    "DISTURBANCES", "HIDDEN", "REMEMBERED", "SHORT_PROTOCOL", "STILL", "WEIGHED", "Disturbance", "HiddenEffect", "Scenario",
    "Truth", "draw_disturbance", "draw_scenario", "make_dataset", "truth_path",
]  # fmt: skip
