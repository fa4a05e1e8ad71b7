"""Add a cause by hand and see whether the error falls."""

import palpate as pp

experiment = pp.register("my-block")
thin = experiment.with_effects(pp.effects.ToolRadius(radius=4.2e-3))
for name, model in (("as stated", experiment), ("with the thin tool", thin)):
    errors = pp.compare(model.replay("poke-top-01", every=4))
    print(f"{1e3 * errors.rms:.3f} mm RMS {name}")
