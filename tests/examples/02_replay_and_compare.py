"""Replay one sequence as stated and compare it with the clouds."""

import palpate as pp

experiment = pp.register(pp.open_dataset("my-block"))
print(*experiment.warnings, sep="\n")
replay = experiment.replay("poke-top-01", every=4)
errors = pp.compare(replay)
print(f"{1e3 * errors.rms:.2f} mm RMS, up to {abs(replay.force).max():.2f} N")
