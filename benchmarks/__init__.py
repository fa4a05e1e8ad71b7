"""Speed and accuracy of the engine: each benchmark checks its result, then prints the time. Run with `python -m benchmarks`."""
