"""Many parameter sets of one motion at once, on a processor or on a graphics card (torch)."""

from core.batch.replay import replay_batch

__all__ = ["replay_batch"]
