"""The view of each open page, drawn in the scenes of its browsers."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.app.drawing.view import MODELS, Model, Quantity, View
from palpate.app.http_errors import Missing
from palpate.app.scene.annotations import annotations_of
from palpate.app.scene.model_layer import end_of_scale
from palpate.app.scene.picture import Picture
from palpate.app.scene.sequence_renderer import SequenceRenderer
from palpate.app.scene.viewer_scene import PageScene
from palpate.app.scene.viewpoint import Direction, Viewpoint, viewpoint_for
from palpate.app.storage.run_store import Run, RunStore
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import PalpateError

if TYPE_CHECKING:
    from palpate.recording.interactive import InteractiveFrame
    from palpate.recording.resolve_frame import ResolvedFrame

__all__ = ["FrameOverride", "InteractiveOverride", "Session", "Sessions"]

log = logging.getLogger(__name__)
MOST_RENDERERS = 6
"""Number of sequences whose renderers are cached."""
MOST_SESSIONS = 32
"""Number of pages whose view is stored."""


@dataclass(frozen=True, eq=False)
class FrameOverride:
    """A frame solved again that a page shows instead of the extended model's."""

    run: str
    sequence: str
    frame: int
    solution: ResolvedFrame

    def fits(self, view: View, frame: int) -> bool:
        """Whether this is the frame that the view shows."""
        return (self.run, self.sequence, self.frame) == (view.run, view.sequence, frame)


@dataclass(frozen=True, eq=False)
class InteractiveOverride:
    """An interactive replay that a page shows instead of one of the run's models."""

    run: str
    sequence: str
    model: Model
    solution: InteractiveFrame

    def adapted(self, view: View) -> View:
        """The view without cloud, error and other models, none of which exist for this push."""
        layers = (
            *(layer for layer in view.layers if layer not in ("measured", *MODELS)),
            self.model,
        )
        looks = {layer: look for layer, look in view.looks.items() if layer != self.model}
        quantity = "displacement" if view.quantity == "error" else view.quantity
        limit = view.limit if quantity == view.quantity else None
        changes = {
            "layers": layers,
            "looks": looks,
            "quantity": quantity,
            "limit": limit,
            "side_by_side": False,
        }
        return view.model_copy(
            update={**changes, "colour": "plain" if view.colour == "plain" else self.model}
        )


class Session:
    """One page: its view, the picture of it, and the scenes of its browsers."""

    def __init__(
        self,
        identity: str,
        renderer_of: Callable[[str, str], SequenceRenderer],
        end_of: Callable[[str, Quantity], float | None],
    ) -> None:
        self.identity = identity
        self._shown: tuple[View, Picture] | None = None
        self._override: FrameOverride | None = None
        self._interactive: InteractiveOverride | None = None
        self._viewpoint: tuple[str, Viewpoint] | None = None
        self._renderer_of, self._end_of = renderer_of, end_of
        self._scenes: list[PageScene] = []
        self._framed: tuple[str, tuple[tuple[float, float, float], ...]] | None = None
        self._lock = threading.Lock()

    @property
    def view(self) -> View | None:
        """The view that is drawn."""
        return None if self._shown is None else self._shown[0]

    @property
    def picture(self) -> Picture | None:
        """The picture of that view."""
        return None if self._shown is None else self._shown[1]

    def show(self, view: View) -> dict[str, Any]:
        """Draw this view in all scenes of the page and return its state."""
        self._draw(view)
        return self.state()

    def _draw(self, view: View) -> None:
        with self._lock:
            renderer = self._renderer_of(view.run, view.sequence)
            frame = min(view.frame, len(renderer.replay) - 1)
            if self._override is not None and self._override.fits(view, frame):
                renderer = renderer.instead(frame, self._override.solution)
            shown = seen = view.model_copy(update={"frame": frame})
            if self._interactive is not None and (
                self._interactive.run,
                self._interactive.sequence,
            ) == (view.run, view.sequence):
                renderer, seen = (
                    renderer.instead(frame, self._interactive.solution, self._interactive.model),
                    self._interactive.adapted(seen),
                )
            picture = renderer.picture(
                seen, self._end_of(seen.run, seen.quantity) if seen.scale == "fixed" else None
            )
            # In one assignment: other threads read a view together with its own picture.
            self._shown = (shown, picture)
            for scene in self._scenes:
                scene.draw(picture)
            if self._framed != (view.run, picture.columns):
                if self._framed is not None:
                    self._viewpoint = None
                self._look()
            self._framed = (view.run, picture.columns)

    def override_frame(self, override: FrameOverride | None) -> None:
        """Show this solution instead of the extended model's frame; None shows the model again."""
        with self._lock:
            self._override, view = override, self.view
        if view is not None:
            self._draw(view)

    def show_interactive(self, override: InteractiveOverride | None) -> None:
        """Show an interactive replay; None shows the recording again."""
        with self._lock:
            self._interactive, view = override, self.view
        if view is not None:
            self._draw(view)

    def needs_inside(self) -> bool:
        """Whether the view can only be drawn with the interior of the block."""
        view = self.view
        if view is None:
            return False
        lumps = "lump" in view.layers and self._renderer_of(view.run, view.sequence).lumps
        return view.section is not None or view.quantity == "energy" or bool(lumps)

    def look(self, where: Direction = "reset") -> None:
        """Turn the cameras of all scenes to the phantom."""
        with self._lock:
            self._viewpoint = None
            self._look(where)

    def look_from(self, run: str, viewpoint: Viewpoint) -> None:
        """Use this viewpoint for a run, also in scenes that open later."""
        with self._lock:
            self._viewpoint = (run, viewpoint)
            if self.view is not None and self.view.run == run:
                self._look()

    def _look(self, where: Direction = "reset") -> None:
        if self.view is None or self.picture is None:
            return
        renderer = self._renderer_of(self.view.run, self.view.sequence)
        eye = renderer.replay.camera("raw").translation
        viewpoint = viewpoint_for(*renderer.corners, eye, self.picture.columns, where)
        if self._viewpoint is not None and self._viewpoint[0] == self.view.run:
            viewpoint = self._viewpoint[1]
        for scene in self._scenes:
            scene.look(viewpoint)

    def still(self, width: int, height: int) -> np.ndarray[Any, Any]:
        """Image of the page's scene (height, width, 4); raises Missing where no browser
        shows it.
        """
        with self._lock:
            scenes = list(self._scenes)
        for scene in reversed(scenes):
            image = scene.still(width, height)
            if image is not None:
                return image
        raise Missing(
            "no browser shows this page, so that there is nothing to take a picture of",
            session=self.identity,
        )

    def join(self, scene: PageScene) -> None:
        """Add a browser's scene, and draw the page's view in it."""
        with self._lock:
            self._scenes.append(scene)
            if self.view is None or self.picture is None:
                self._framed = None
                return
            self._look()
            scene.draw(self.picture)

    def leave(self, scene: PageScene) -> None:
        """Remove a browser's scene."""
        with self._lock:
            self._scenes = [other for other in self._scenes if other is not scene]

    def state(self) -> dict[str, Any]:
        """The view, and counts and a digest of the arrays drawn."""
        shown = self._shown
        if shown is None:
            return {"view": None, "drawn": None, "scenes": len(self._scenes)}
        return {
            "view": shown[0].model_dump(),
            "drawn": shown[1].summary(),
            "scenes": len(self._scenes),
        }


class Sessions:
    """All open pages and the renderers of the latest sequences; the least recently used are
    dropped.
    """

    def __init__(
        self,
        runs: RunStore,
        clouds_of: Callable[[Run, str], Callable[[int], FloatArray] | None] | None = None,
    ) -> None:
        self._runs = runs
        self._clouds_of = clouds_of or measured_clouds
        self._sessions: OrderedDict[str, Session] = OrderedDict()
        self._renderers: OrderedDict[tuple[str, str, tuple[int, ...]], SequenceRenderer] = (
            OrderedDict()
        )
        self._ends: dict[tuple[str, Quantity], float | None] = {}
        self._lock = threading.Lock()

    def get(self, identity: str) -> Session:
        """The session of a page that has shown something; raises Missing for others."""
        with self._lock:
            if identity not in self._sessions:
                raise Missing(f"no page with the id {identity} is open", session=identity)
            return self._sessions[identity]

    def open(self, identity: str) -> Session:
        """The session of a page; a new one if there is none."""
        with self._lock:
            session = self._sessions.pop(identity, None) or Session(
                identity, self.renderer, self.end
            )
            self._sessions[identity] = session
            while len(self._sessions) > MOST_SESSIONS:
                self._sessions.popitem(last=False)
            return session

    def join(self, identity: str, scene: PageScene) -> None:
        """Add a browser's scene to a page."""
        self.open(identity).join(scene)

    def leave(self, identity: str, scene: PageScene) -> None:
        """Remove a browser's scene from a page."""
        self.open(identity).leave(scene)

    def renderer(self, run: str, sequence: str) -> SequenceRenderer:
        """The renderer of a sequence of a run."""
        with self._lock:
            opened = self._runs.get(run)
            key = (run, sequence, opened.stamp(sequence))
            renderer = self._renderers.pop(key, None)
            if renderer is None:
                renderer = SequenceRenderer(
                    opened.replay(sequence),
                    self._clouds_of(opened, sequence),
                    annotations_of(opened),
                )
            self._renderers[key] = renderer
            while len(self._renderers) > MOST_RENDERERS:
                self._renderers.popitem(last=False)
            return renderer

    def end(self, run: str, quantity: Quantity) -> float | None:
        """Common end of the scale for all sequences of a run; None where none has the quantity."""
        key = (run, quantity)
        if key not in self._ends:
            opened = self._runs.get(run)
            ends = [
                end_of_scale(opened.replay(sequence), quantity) for sequence in opened.sequences
            ]
            self._ends[key] = max((end for end in ends if end is not None), default=None)
        return self._ends[key]


def measured_clouds(run: Run, sequence: str) -> Callable[[int], FloatArray] | None:
    """The raw clouds of a sequence from the run's dataset, or None when the data are not where the
    run says.
    """
    from palpate.dataset import open_dataset

    folder = run.origin.get("dataset")
    if folder is None or not Path(folder).is_dir():
        return None
    try:
        return open_dataset(Path(folder)).sequence(sequence).cloud
    except PalpateError as error:
        log.warning("run %s: the measured clouds are not shown: %s", run.name, error.message)
        return None
