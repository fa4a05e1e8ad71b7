"""Budget of work for each push of a replay, so that none goes on for ever.

Work is counted and not timed, so that a replay gives the same frames on every machine.
"""

from __future__ import annotations

__all__ = ["WorkBudget", "WorkSpentError"]

PER_PUSH, PER_FRAME = 2000.0, 20.0
"""Work of a push, and more for each of its frames, in factorisations of the tangent. Measured over
150 random situations (`benchmarks.situations`): half of them take up to 4 factorisations a frame,
and the worst 1329 for seven frames. A factorisation on the grid of the page takes about 25 ms."""


class WorkSpentError(Exception):
    """The work of a push exceeds its budget; it ends the solve that is under way."""


class WorkBudget:
    """The work of the present push.

    Work between frames (derivatives, a finer mesh) does not count: it could not be given up.

    Attributes:
        given_up: whether the present push was given up.
    """

    def __init__(self) -> None:
        self.given_up, self._counting = False, False
        self._spent, self._most = 0.0, PER_PUSH

    def begin_frame(self, clear: bool) -> None:
        """Begin a frame; one whose tool is clear of the block begins another push."""
        if clear:
            self.given_up, self._spent, self._most = False, 0.0, PER_PUSH
        self._most += PER_FRAME
        self._counting = True

    def end_frame(self) -> None:
        """End a frame; what follows until the next one does not count."""
        self._counting = False

    def spend(self, work: float) -> None:
        """Count work, in factorisations; raises WorkSpentError above the budget."""
        if not self._counting:
            return
        self._spent += work
        if self._spent > self._most:
            self.given_up = True
            raise WorkSpentError
