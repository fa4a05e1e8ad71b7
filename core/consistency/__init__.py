"""Contradictions between what a dataset says twice: robot, camera, forces, rest cloud and shape.

`check_consistency` compares them with few general measures, so that a lie is noticed in whatever
form it comes.
"""

from palpate.consistency.consistency_check import check_consistency

__all__ = ["check_consistency"]
