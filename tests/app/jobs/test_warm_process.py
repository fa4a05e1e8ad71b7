from __future__ import annotations

import os
import threading
import time

from palpate.app.jobs.warm_process import WarmProcess


def test_solver_outlives_the_thread_that_asked_first() -> None:
    solver = WarmProcess()
    found: list[int] = []
    try:
        asking = threading.Thread(target=lambda: found.append(solver.ask(os.getpid)))
        asking.start()
        asking.join()
        time.sleep(0.5)
        assert solver.ask(os.getpid) == found[0]
    finally:
        solver.close()
