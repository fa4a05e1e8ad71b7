from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_dataset import SIZE

from palpate.app.http_errors import Conflict
from palpate.app.storage.registration_store import RegistrationStore
from palpate.foundation.frames import Transform

X, Y, Z = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
TRUE = Transform(
    Rotation.from_euler("xyz", [2.5, 0.1, 0.2]).as_matrix(), np.array([0.01, 0.02, 0.35])
).inverse()
"""phantom_from_camera of the small dataset"""
MESH = np.array([[X, Y, Z], [-X, Y, Z], [-X, -Y, Z]])
URL = "/api/datasets/small/registrations"


def pairs(off: float = 0.0) -> list[dict[str, Any]]:
    clicked = TRUE.inverse().apply(MESH + np.array([[off, 0, off], [0, -off, 0], [0, off, -off]]))
    return [
        {"cloud": one.tolist(), "mesh": other.tolist()}
        for one, other in zip(clicked, MESH, strict=True)
    ]


def test_pairs_are_tried_then_accepted_under_a_name_that_is_never_overwritten(
    client: httpx.Client, shared_place: Any
) -> None:
    before = sorted((path, path.stat().st_mtime_ns) for path in shared_place.datasets.rglob("*"))
    tried = client.post(URL, json={"pairs": pairs(off=0.001)})
    assert tried.status_code == 200, tried.text
    assert client.get(URL).json() == {"registrations": []}
    found = tried.json()["registration"]
    off = TRUE @ Transform.from_matrix(found["phantom_from_camera"]).inverse()
    # The regular cloud shows the top and the table only: height and tilt are found, the rest stays
    # with the pairs.
    assert abs(off.apply(np.array([0.0, 0.0, Z]))[2] - Z) < 5e-4
    assert np.degrees(np.linalg.norm(off.rotation_vector[:2])) < 0.5
    assert found["weak_directions"] and found["residual_after"] < found["residual_before"]
    stored = client.post(URL, json={"pairs": pairs(), "accept": "by-hand"}).json()
    assert client.get(f"{URL}/by-hand").json() == stored
    assert client.get(URL).json() == {"registrations": ["by-hand"]}
    assert client.post(URL, json={"pairs": pairs(), "accept": "by-hand"}).status_code == 409
    assert client.get(f"{URL}/by-hand").json() == stored
    refused = client.post(URL, json={"pairs": pairs()[:2]})
    assert refused.status_code == 422 and refused.json()["where"] == {"pairs": 2}
    assert (
        sorted((path, path.stat().st_mtime_ns) for path in shared_place.datasets.rglob("*"))
        == before
    )


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"pairs": [{"cloud": [0, 0], "mesh": [0, 0, 0]}]},
        {"pairs": [{"cloud": [0, 0, 1e9], "mesh": [0, 0, 0]}]},
    ],
)
def test_bodies_that_are_no_pairs_are_refused(client: httpx.Client, body: Any) -> None:
    answer = client.post(URL, json=body)
    assert answer.status_code == 422 and set(answer.json()) == {"kind", "message", "where"}


def test_unknown_names_are_not_found_and_names_that_lead_elsewhere_refused(
    client: httpx.Client,
) -> None:
    assert client.get("/api/datasets/nothing/registrations").status_code == 404
    assert client.get(f"{URL}/nothing").status_code == 404
    assert client.get(f"{URL}/..%2f..%2forigin").status_code == 404


def test_a_name_taken_meanwhile_is_refused_and_the_older_one_stays(tmp_path: Path) -> None:
    store = RegistrationStore(tmp_path, "small")
    first = store.save("a", {"registration": 1})
    with pytest.raises(Conflict, match="already"):
        store.save("a", {"registration": 2})
    assert store.request("a") == first
    assert [path.name for path in (tmp_path / "registrations" / "small").iterdir()] == ["a.json"]


def test_the_fit_of_the_pairs_alone_comes_at_once_with_each_pairs_residual(
    client: httpx.Client,
) -> None:
    fit = client.post(f"{URL}/fit", json={"pairs": pairs()}).json()
    assert np.allclose(fit["phantom_from_camera"], TRUE.matrix, atol=1e-6)
    assert len(fit["residuals"]) == 3 and fit["rms"] < 1e-6
    mirrored = pairs()
    for pair in mirrored:
        pair["mesh"][0] *= -1
    answer = client.post(f"{URL}/fit", json={"pairs": mirrored})
    assert answer.status_code == 422 and "mirrored" in answer.json()["message"]
