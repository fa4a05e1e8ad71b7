"""Nuisances of real benches: faults of cameras, robots, tools and phantoms that no effect states.

A nuisance is one class in one file. `nuisance_draws` draws them, from a random stream of their own.
"""

from palpate.synthetic.nuisances.cameras import CAMERAS
from palpate.synthetic.nuisances.nuisance import DepthImage, Nuisance, StatedMotion
from palpate.synthetic.nuisances.nuisance_draws import FAULTS, FILTERS, NUISANCES, draw_nuisances

__all__ = [
    "CAMERAS",
    "FAULTS",
    "FILTERS",
    "NUISANCES",
    "DepthImage",
    "Nuisance",
    "StatedMotion",
    "draw_nuisances",
]
