from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapes import dome
from small_dataset import SIZE, small_cloud

from palpate.app.drawing.colours import BANDS, EXTENDED, RAW, SEQUENTIAL, SIGNED, band_of
from palpate.app.drawing.figures import (
    CloudFigure,
    LabelFigure,
    LinesFigure,
    SurfaceFigure,
    ToolFigure,
)
from palpate.app.drawing.free_surface import FreeSurface
from palpate.app.drawing.view import Layer, View
from palpate.app.scene.annotations import TICK, TICKS_APART, Annotations, annotations_of
from palpate.app.scene.page_session import Session
from palpate.app.scene.picture import Picture
from palpate.app.scene.sequence_renderer import MOST_TRIANGLES, SequenceRenderer
from palpate.app.scene.stiffness_surface import StiffnessSurface
from palpate.app.storage.run_store import Run
from palpate.setup.box import Box
from palpate.setup.phantom_geometry import Geometry

ALL: tuple[Layer, ...] = ("measured", "raw", "extended", "tool")


@pytest.fixture
def renderer(place: object, tmp_path: Path, run_name: str) -> SequenceRenderer:
    run = Run(tmp_path / "runs" / run_name)
    return SequenceRenderer(
        run.replay("poke-01"), lambda index: small_cloud() + 1e-6 * index, annotations_of(run)
    )


def show(renderer: SequenceRenderer, **changes: Any) -> Picture:
    wish = {"run": "r", "sequence": "poke-01", "frame": 2, "layers": ALL, "crop": False, **changes}
    return renderer.picture(View.model_validate(wish))


def names(picture: Picture, kind: type[Any]) -> list[str]:
    return list(picture.of(kind))


def test_plain_picture_has_the_extended_model_as_surface_and_the_raw_one_as_lines(
    renderer: SequenceRenderer,
) -> None:
    picture = show(renderer)
    assert names(picture, SurfaceFigure) == ["extended"]
    assert picture.of(SurfaceFigure)["extended"].colour == EXTENDED
    assert picture.of(LinesFigure)["raw-lines"].colour == RAW
    assert picture.limit is None and picture.quantity is None


def test_coloured_picture_shares_all_triangles_among_the_bands(renderer: SequenceRenderer) -> None:
    picture = show(renderer, colour="raw", limit=2e-4)
    meshes = picture.of(SurfaceFigure)
    total = sum(len(mesh.faces) for mesh in meshes.values())
    assert total == 8**2 * len(renderer.replay["faces"])
    assert total <= MOST_TRIANGLES
    assert "raw-error-unseen" in meshes
    assert (picture.quantity, picture.limit) == ("error", 2e-4)
    for name, mesh in meshes.items():
        assert mesh.faces.max() < len(mesh.vertices)
        if not name.endswith("unseen"):
            assert mesh.colour == SIGNED[int(name.removeprefix("raw-error-"))]


def test_colour_of_a_place_is_the_band_of_its_error(renderer: SequenceRenderer) -> None:
    picture = show(renderer, colour="raw", limit=5e-4, layers=("raw",))
    raw, errors = renderer.replay["raw"][2], renderer.replay["error_raw"][2]
    top = np.flatnonzero((renderer.replay["rest"][:, 2] > SIZE[2] - 1e-9) & np.isfinite(errors))
    for name, mesh in picture.of(SurfaceFigure).items():
        if name.endswith("unseen"):
            continue
        band = int(name.removeprefix("raw-error-"))
        gaps = np.linalg.norm(mesh.vertices[:, None] - raw[None, top], axis=-1)
        at = top[np.unique(np.nonzero(gaps < 1e-7)[1])]
        assert np.all(np.abs(band_of(errors[at].astype(float), 5e-4) - band) <= 2)
    assert len(picture.of(SurfaceFigure)) > BANDS // 2


def test_displacement_is_coloured_from_zero_and_energy_says_that_it_was_not_recorded(
    renderer: SequenceRenderer,
) -> None:
    picture = show(renderer, colour="raw", quantity="displacement")
    assert picture.quantity == "displacement"
    assert picture.limit == pytest.approx(3e-3, rel=0.4)
    deepest = max(name for name in picture.of(SurfaceFigure) if name.startswith("raw-displacement"))
    assert picture.of(SurfaceFigure)[deepest].colour == SEQUENTIAL[int(deepest[-2:])]
    assert picture.of(SurfaceFigure)["raw-displacement-00"].colour == SEQUENTIAL[0]
    old = show(renderer, colour="raw", quantity="energy")
    assert (
        names(old, SurfaceFigure) == ["raw"]
        and old.limit is None
        and renderer.end("energy") is None
    )


def test_hidden_layers_are_not_in_the_picture(renderer: SequenceRenderer) -> None:
    picture = show(renderer, layers=())
    assert picture.figures == {} and picture.points == 0


def test_choosing_the_error_of_a_hidden_model_shows_the_other_one_plain(
    renderer: SequenceRenderer,
) -> None:
    picture = show(renderer, colour="raw", layers=("extended",))
    assert names(picture, SurfaceFigure) == ["extended"]
    assert picture.limit is None


def test_each_layer_has_a_look_of_its_own(renderer: SequenceRenderer) -> None:
    looks = {
        "raw": {"lines": False, "opacity": 0.4},
        "extended": {"coloured": True},
        "tool": {"opacity": 0.5},
    }
    picture = show(renderer, looks=looks)
    assert picture.of(SurfaceFigure)["raw"].opacity == 0.4
    assert picture.of(SurfaceFigure)["extended-error-unseen"].opacity == 1.0
    assert names(picture, LinesFigure) == []
    assert picture.of(ToolFigure)["tool"].opacity == 0.5
    assert show(renderer, looks={"measured": {"opacity": 0.5}}).points == show(renderer).points / 2


def test_side_by_side_each_model_stands_apart_with_its_name_cloud_and_tool(
    renderer: SequenceRenderer,
) -> None:
    picture = show(renderer, side_by_side=True, colour="raw")
    assert {label.text for label in picture.of(LabelFigure).values()} == {
        "Raw model",
        "Extended model",
    }
    assert set(picture.of(CloudFigure)) == {"cloud-raw", "cloud-extended"}
    tools = picture.of(ToolFigure)
    assert (tools["tool-raw"].radius, tools["tool-extended"].radius) == (0.005, 0.004)
    apart = np.array(tools["tool-extended"].at) - np.array(tools["tool-raw"].at)
    assert np.linalg.norm(apart) > 0.04
    assert {name.split("-")[0] for name in picture.of(SurfaceFigure)} == {"raw", "extended"}
    assert all(
        np.allclose(mesh.at, tools[f"tool-{name.split('-')[0]}"].at)
        for name, mesh in picture.of(SurfaceFigure).items()
    )


def test_cloud_is_moved_into_the_phantom_frame_and_cut_to_the_block(
    renderer: SequenceRenderer,
) -> None:
    whole, near = show(renderer), show(renderer, crop=True)
    expected = renderer.replay.camera("extended").apply(small_cloud() + 2e-6)
    np.testing.assert_allclose(
        whole.of(CloudFigure)["cloud"].points[: whole.points], expected, atol=1e-7
    )
    assert whole.points == 192
    assert near.points < whole.points


def test_cloud_has_one_length_for_the_whole_sequence(renderer: SequenceRenderer) -> None:
    assert {
        len(show(renderer, frame=frame).of(CloudFigure)["cloud"].points) for frame in range(5)
    } == {1000}


def test_tool_has_the_radius_that_the_surface_model_believes(renderer: SequenceRenderer) -> None:
    assert [
        show(renderer, colour=colour).of(ToolFigure)["tool"].radius
        for colour in ("raw", "extended")
    ] == [0.005, 0.004]


def test_checksum_tells_frames_and_layers_apart(renderer: SequenceRenderer) -> None:
    pictures = [
        show(renderer),
        show(renderer, frame=3),
        show(renderer, layers=("raw",)),
        show(renderer, colour="raw"),
    ]
    assert len({picture.checksum() for picture in pictures}) == 4
    assert show(renderer).checksum() == show(renderer).checksum()


def test_automatic_scale_is_one_for_the_whole_sequence(renderer: SequenceRenderer) -> None:
    limits = {
        show(renderer, frame=frame, colour=colour).limit
        for frame in range(5)
        for colour in ("raw", "extended")
    }
    assert limits == {renderer.limit}


def test_a_section_leaves_out_what_lies_beyond_and_the_cloud_there(
    renderer: SequenceRenderer,
) -> None:
    cut = {"axis": "x", "at": 0.004}
    for flip in (False, True):
        picture = show(
            renderer, section={**cut, "flip": flip}, colour="raw", layers=("raw", "measured")
        )
        places = np.concatenate([mesh.vertices for mesh in picture.of(SurfaceFigure).values()])[
            :, 0
        ]
        assert (places.min() > 0.003) if flip else (places.max() < 0.005)
        assert np.all((picture.of(CloudFigure)["cloud"].points[:, 0] > 0.004) == flip)
    assert len(show(renderer, section=cut).of(LinesFigure)["raw-lines"].segments) < len(
        show(renderer).of(LinesFigure)["raw-lines"].segments
    )


def test_map_of_the_stiffness_is_a_skin_over_the_moved_body(renderer: SequenceRenderer) -> None:
    rest = np.asarray(renderer.replay["rest"], dtype=float)
    known = np.where(rest[:, 0] > 0, 0.3, np.nan)
    notes = Annotations(np.zeros((0, 3)), np.zeros((0, 3)), stiffness=StiffnessSurface(rest, known))
    mapped = SequenceRenderer(renderer.replay, None, notes)
    assert mapped.mapped and not renderer.mapped
    shown = show(mapped, layers=("raw", "lump")).of(SurfaceFigure)
    skin = {name: figure for name, figure in shown.items() if name.startswith("stiffness")}
    assert set(skin) == {"stiffness-unseen", f"stiffness-{BANDS - 1:02d}"}
    low, high = (
        np.concatenate([figure.vertices for figure in figures]).min(axis=0)
        for figures in (skin.values(), [shown["raw"]])
    )
    assert np.abs(low - high).max() < 1e-3  # just outside the body
    assert "stiffness-unseen" not in show(mapped, layers=("raw",)).of(SurfaceFigure)


def test_lump_landmarks_base_and_path_are_layers(renderer: SequenceRenderer) -> None:
    picture = show(renderer, layers=("extended", "lump", "base", "path", "landmarks"))
    ball, interval = (picture.of(SurfaceFigure)[name] for name in ("lump-0", "lump-0-interval"))
    assert np.ptp(ball.vertices, axis=0) == pytest.approx(2 * 0.0075, rel=0.02)
    assert np.ptp(interval.vertices, axis=0)[0] == pytest.approx(
        2 * 0.008 + 0.0115 - 0.0088, rel=0.02
    )
    assert interval.opacity < ball.opacity < 1
    assert {"base", "path"} <= set(picture.of(LinesFigure))
    assert renderer.lumps == 1 and renderer.landmarks == 0


def free(body: Geometry) -> FreeSurface:
    surface = body.surface()
    return FreeSurface.of(surface.vertices, surface.faces)


def test_hatching_follows_the_base_of_a_free_form_and_of_a_block() -> None:
    none = np.empty((0, 3))
    bare = Annotations(none, none)
    for body in (dome((0.04, 0.03, 0.025)), Box(size=(0.06, 0.04, 0.03))):
        figure = bare.base_figures(free(body), extended=False)["base"]
        assert isinstance(figure, LinesFigure)
        ends = figure.segments.reshape(-1, 3).astype(float) * [1.0, 1.0, 0.0]
        assert np.abs(body.outside(ends)).max() < 3e-3
        lengths = np.linalg.norm(np.diff(figure.segments, axis=1)[:, 0], axis=1)
        ticks = np.abs(lengths - TICK) < 1e-6
        assert ticks.sum() == pytest.approx(lengths[~ticks].sum() / TICKS_APART, abs=1)
    loose = Annotations(none, none, loose=(("-x", 0.02),))
    block = free(Box(size=(0.06, 0.04, 0.03)))
    whole, part = (loose.base_figures(block, extended)["base"] for extended in (False, True))
    assert isinstance(whole, LinesFigure) and isinstance(part, LinesFigure)
    assert len(part.segments) < len(whole.segments)


def test_who_asks_while_a_picture_is_drawn_is_told_the_last_view_with_its_own_picture(
    renderer: SequenceRenderer, run_name: str
) -> None:
    seen: list[dict[str, Any]] = []

    def asked_for(run: str, sequence: str) -> SequenceRenderer:
        seen.append(session.state())
        return renderer

    def end_of(run: str, quantity: str) -> None:
        seen.append(session.state())

    session = Session("page", asked_for, end_of)
    view = View.model_validate(
        {"run": run_name, "sequence": "poke-01", "frame": 1, "colour": "raw", "scale": "fixed"}
    )
    before = session.show(view)
    assert seen[0]["view"] is None and seen[1]["view"] is None
    seen.clear()
    after = session.show(view.model_copy(update={"frame": 3}))
    assert seen == [before, before]
    assert after["view"]["frame"] == 3 and after["drawn"]["checksum"] != before["drawn"]["checksum"]
