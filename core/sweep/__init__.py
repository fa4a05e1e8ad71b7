"""Sweeps: the error against the clouds, over parameters of the setup and of any effect.

What is asked stands here; what does it, `palpate.sweep.run_sweep.run_sweep`, is heavy to import.
"""

from palpate.sweep.parameter_space import Axis, ParameterSpace
from palpate.sweep.sweep_spec import SweepSpec

__all__ = ["Axis", "SweepSpec", "ParameterSpace"]
