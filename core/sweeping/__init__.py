"""Sweeps: the error against the clouds, over parameters of the setup and of any effect.

What is asked stands here; what does it, `core.sweeping.running.run_sweep`, is heavy to import.
"""

from core.sweeping.request import Request
from core.sweeping.space import Axis, Space

__all__ = ["Axis", "Request", "Space"]
