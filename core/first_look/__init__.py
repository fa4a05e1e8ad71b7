"""First look at a recording or a dataset before any job: streams, tool, forces, cuts and clouds."""

from palpate.first_look.first_look import take_look
from palpate.first_look.look_request import LookRequest

__all__ = ["LookRequest", "take_look"]
