from __future__ import annotations

import httpx

from palpate.effects import CATALOGUE, DIAGNOSED


def test_catalogue_is_served_with_units_and_bounds(client: httpx.Client) -> None:
    effects = {effect["name"]: effect for effect in client.get("/api/effects").json()}
    assert list(effects) == [effect.name for effect in CATALOGUE]
    assert [name for name, effect in effects.items() if effect["diagnosed"]] == [
        effect.name for effect in DIAGNOSED
    ]
    assert [name for name, effect in effects.items() if not effect["by_hand"]] == ["geometry_local"]
    radius = effects["tool_radius"]["parameters"][0]
    assert (radius["name"], radius["unit"]) == ("radius", "m")
    assert 0 < radius["low"] < 0.005 < radius["high"]
    edge = next(item for item in effects["base_detachment"]["parameters"] if item["name"] == "edge")
    assert edge["choices"] == ["-x", "+x", "-y", "+y"]
    assert edge["low"] is None
