"""Benchmarks of speed and accuracy; each checks its result before it reports times.

Run with `python -m benchmarks`.
"""

import os

# The tables are of one thread, which has to be set before NumPy is imported.
for _library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
