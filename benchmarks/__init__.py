"""Speed and accuracy of the engine: each benchmark checks its result, then prints the time. Run
with `python -m benchmarks`.
"""

import os

# One thread is what the tables say, and it must be said before numpy is first imported.
for _library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
