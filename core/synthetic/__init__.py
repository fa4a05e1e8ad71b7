"""The virtual bench: datasets with known hidden effects, made through another mesh, element and law than the replay's."""

from core.synthetic.disturbance import DISTURBANCES, Disturbance, draw_disturbance
from core.synthetic.making import make_dataset
from core.synthetic.palpation import Palpation, draw_palpation, make_palpation
from core.synthetic.protocol import PAPER_EFFECTS, PAPER_SEED, PAPER_SIZES, PaperSize, paper_scenario
from core.synthetic.scenario import HIDDEN, QUICK, SHORT_PROTOCOL, WEIGHED, HiddenEffect, Scenario, draw_scenario
from core.synthetic.truth import Truth, truth_path

__all__ = [
    "DISTURBANCES", "HIDDEN", "PAPER_EFFECTS", "PAPER_SEED", "PAPER_SIZES", "QUICK", "SHORT_PROTOCOL", "WEIGHED", "Disturbance",
    "HiddenEffect", "Palpation", "PaperSize", "Scenario", "Truth", "draw_disturbance", "draw_palpation", "draw_scenario",
    "make_dataset", "make_palpation", "paper_scenario", "truth_path",
]  # fmt: skip
