"""Parameter sweeps: the error against the clouds as a function of parameters of any effect.

This module exports the specification of a sweep. `palpate.sweep.run_sweep.run_sweep`, which
executes one, is imported separately because it loads the solver.
"""

from palpate.sweep.parameter_space import Axis, ParameterSpace
from palpate.sweep.sweep_spec import SweepSpec

__all__ = ["Axis", "ParameterSpace", "SweepSpec"]
