"""Make a virtual dataset whose tool is thinner than stated."""

from pathlib import Path

from palpate.synthetic import HiddenEffect, Scenario, make_dataset

if __name__ == "__main__":
    thin_tool = HiddenEffect("tool_radius", {"radius": 4.2e-3})
    names = ("poke-top-01", "poke-top-02", "poke-side-01")
    scenario = Scenario(effects=(thin_tool,), sequences=names, rate=10.0)
    truth = make_dataset(Path("my-block"), scenario, seed=1, workers=2)
    print(truth.as_dict()["effects"])
