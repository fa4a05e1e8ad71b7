"""Places of a report in the frame of the dataset's files."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.diagnosis.report.file_frame import with_places_in_file
from palpate.foundation.frames import Transform

TURN = Transform(Rotation.from_euler("xyz", [1.2, -0.4, 0.3]).as_matrix(), np.array([0, 0, 0.02]))
CENTRE, LINE = np.array([0.01, -0.02, 0.015]), np.array([[-0.03, 0, 0.01], [0.03, 0.01, 0.01]])


def report(**keys: Any) -> dict[str, Any]:
    there = TURN.apply(CENTRE)
    lump = {
        "effect": "stiff_inclusion",
        "parameters": {
            axis: {"value": float(value), "unit": "m"}
            for axis, value in zip("xyz", there, strict=True)
        },
    }
    tube = {"effect": "stiff_tube", "parameters": {}, "polyline": TURN.apply(LINE).tolist()}
    other = {"effect": "tool_radius", "parameters": {"radius": {"value": 0.004, "unit": "m"}}}
    probes = [
        {
            "kind": "top",
            "place": TURN.apply(CENTRE).tolist(),
            "direction": TURN.rotate(np.array([0.0, 0.0, -1.0])).tolist(),
        },
        {"kind": "measurement"},
    ]
    return {"causes": [lump, tube, other], "next_probe": probes, **keys}


def test_places_are_those_of_the_files_and_nothing_else_changes() -> None:
    before = report(phantom_from_file=TURN.matrix.tolist())
    after = with_places_in_file(before)
    lump, tube, other = after["causes"]
    np.testing.assert_allclose(lump["in_file_frame"]["centre"], CENTRE, atol=1e-5)
    np.testing.assert_allclose(tube["in_file_frame"]["polyline"], LINE, atol=1e-5)
    push, measurement = after["next_probe"]
    np.testing.assert_allclose(push["in_file_frame"]["place"], CENTRE, atol=1e-5)
    np.testing.assert_allclose(push["in_file_frame"]["direction"], [0, 0, -1], atol=1e-5)
    assert other == before["causes"][2] and measurement == before["next_probe"][1]
    for entry in (lump, tube, push):
        del entry["in_file_frame"]
    assert after == before


def test_report_in_the_frame_of_its_files_stays_as_it_is() -> None:
    assert with_places_in_file(report()) == report()
