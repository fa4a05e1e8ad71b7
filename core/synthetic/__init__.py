"""The virtual bench: datasets with known hidden effects.

`scenario` says what is hidden, `bench` has the block, the tool and the sensors, and `solver` is a
finite-element solver with another mesh, element and material law than the replay. `make_dataset`,
`make_palpation` and `make_shape_dataset` write whole datasets with their truth beside them.
"""

from palpate.synthetic.bodies.robot_relation import ROBOT_RELATIONS
from palpate.synthetic.bodies.shape_families import FAMILIES
from palpate.synthetic.make_dataset import make_dataset
from palpate.synthetic.make_palpation import Palpation, draw_palpation, make_palpation
from palpate.synthetic.make_shape_dataset import (
    ON_SHAPES,
    ShapeScenario,
    draw_shape_scenario,
    make_shape_dataset,
)
from palpate.synthetic.nuisances import (
    CAMERAS,
    FAULTS,
    FILTERS,
    NUISANCES,
    Nuisance,
    draw_nuisances,
)
from palpate.synthetic.scenario.disturbance import (
    DISTURBANCES,
    OF_ANY_BODY,
    WEIGHED_DISTURBANCES,
    Disturbance,
    draw_disturbance,
)
from palpate.synthetic.scenario.hidden_effects import HIDDEN, QUICK, WEIGHED, HiddenEffect
from palpate.synthetic.scenario.paper_protocol import (
    PAPER_EFFECTS,
    PAPER_SEED,
    PAPER_SIZES,
    PaperSize,
    paper_scenario,
)
from palpate.synthetic.scenario.scenario import SHORT_PROTOCOL, Scenario
from palpate.synthetic.scenario.scenario_draws import draw_scenario
from palpate.synthetic.scenario.truth_file import Truth, read_truth, truth_path

__all__ = [
    "CAMERAS",
    "DISTURBANCES",
    "FAMILIES",
    "FAULTS",
    "FILTERS",
    "HIDDEN",
    "NUISANCES",
    "OF_ANY_BODY",
    "ON_SHAPES",
    "PAPER_EFFECTS",
    "PAPER_SEED",
    "PAPER_SIZES",
    "QUICK",
    "ROBOT_RELATIONS",
    "SHORT_PROTOCOL",
    "WEIGHED",
    "WEIGHED_DISTURBANCES",
    "Disturbance",
    "HiddenEffect",
    "Nuisance",
    "Palpation",
    "PaperSize",
    "Scenario",
    "ShapeScenario",
    "Truth",
    "draw_disturbance",
    "draw_nuisances",
    "draw_palpation",
    "draw_scenario",
    "draw_shape_scenario",
    "make_dataset",
    "make_palpation",
    "make_shape_dataset",
    "paper_scenario",
    "read_truth",
    "truth_path",
]
