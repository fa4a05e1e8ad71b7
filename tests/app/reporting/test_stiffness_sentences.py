"""The free map of the stiffness in words, and as a skin over the body."""

from __future__ import annotations

import numpy as np

from palpate.app.drawing.figures import SurfaceFigure
from palpate.app.drawing.surface_bands import refine
from palpate.app.reporting.stiffness_sentences import stiffness_sentences
from palpate.app.scene.stiffness_surface import stiffness_surface_of
from palpate.foundation.quantities import NARROW
from palpate.setup.setup import Box

FOUND = {
    "structured": True,
    "gain_nats": 31.24,
    "bound_nats": 4.0,
    "trusted_share": 0.42,
    "unfelt_ends": ["-x"],
    "parts": [
        {"at": [0.01, -0.004, 0.03], "ratio": 1.4, "low": 1.2, "high": 1.7, "pushes": [3, 7, 9]},
        {"at": [0.02, 0.0, 0.03], "ratio": 3.8, "low": 1.81, "high": 11.8, "pushes": [1, 4]},
        {"at": [-0.01, 0.0, 0.03], "ratio": 0.6, "low": 0.4, "high": 0.9, "pushes": [2]},
    ],
    "surface": [
        {"at": [-0.015, 0.0, 0.02], "ratio": 1.0, "trusted": False},
        {"at": [0.015, 0.0, 0.02], "ratio": 2.0, "trusted": True},
    ],
}


def test_parts_pushes_and_what_was_not_felt_are_said() -> None:
    told = [text.replace(NARROW, " ") for text in stiffness_sentences({"stiffness_map": FOUND})]
    assert told == [
        "Stiffer than the rest by 40 % (20 to 70) around (10, -4, 30) mm, "
        "felt by pushes 3, 7 and 9.",
        "3.8 times as stiff as the rest (1.8 to 11.8) around (20, 0, 30) mm, "
        "felt by pushes 1 and 4.",
        "Softer than the rest by 40 % (10 to 60) around (-10, 0, 30) mm, felt by push 2.",
        "Free map of the stiffness: 31.2 nats over a uniform body, 4.0 are needed; told below "
        "42 % of the surface; the end towards -x was not felt.",
    ]


def test_map_of_noise_is_left_out_with_a_word() -> None:
    noise = {
        **FOUND,
        "structured": False,
        "why_not": "a free map shows nothing beyond noise",
        "gain_nats": 1.0,
    }
    (told,) = stiffness_sentences({"stiffness_map": noise})
    assert told.startswith("A free map shows nothing beyond noise (1.0 nats")
    assert stiffness_sentences({"verdict": "none"}) == []
    assert stiffness_surface_of({"stiffness_map": {**noise, "surface": []}}) is None


def test_skin_is_grey_where_the_data_do_not_tell_and_lies_just_outside() -> None:
    skin = stiffness_surface_of({"stiffness_map": FOUND})
    assert skin is not None
    rest, faces = Box(size=(0.04, 0.02, 0.02)).closed_surface
    drawn = skin.figures(refine(rest, faces, 4), rest, rest + np.array([0.0, 0.0, 0.01]), 1.0)
    figures = {key: one for key, one in drawn.items() if isinstance(one, SurfaceFigure)}
    assert len(figures) == len(drawn) == 2 and "stiffness-unseen" in figures
    sides = {name: np.asarray(figure.vertices)[:, 0] for name, figure in figures.items()}
    grey = sides.pop("stiffness-unseen")
    (coloured,) = sides.values()
    assert grey.mean() < 0 < coloured.mean()
    places = np.concatenate([np.asarray(figure.vertices) for figure in figures.values()])
    assert 0.03 < places[:, 2].max() < 0.031 and np.abs(places[:, 0]).max() < 0.021
