from __future__ import annotations

import httpx
from small_dataset import SIZE

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


def test_catalogue_for_a_dataset_says_what_its_phantom_can_have(client: httpx.Client) -> None:
    found = client.get("/api/effects", params={"dataset": "small"}).json()
    effects = {effect["name"]: effect for effect in found}
    assert "surface" in effects["geometry_local"]["impossible"]
    assert effects["stiff_inclusion"]["impossible"] is None
    items = {item["name"]: item for item in effects["stiff_inclusion"]["parameters"]}
    for axis, name in enumerate("xy"):
        assert items[name]["span"] == [-SIZE[axis] / 2, SIZE[axis] / 2]
    assert items["radius"]["span"] is None
    # A lump of the phantom's own stiffness would be none, wherever it is.
    assert items["stiffness_ratio"]["begin"] > 1
    assert effects["tool_radius"]["parameters"][0]["begin"] == 0.005
    assert client.get("/api/effects", params={"dataset": "nowhere"}).status_code == 404
