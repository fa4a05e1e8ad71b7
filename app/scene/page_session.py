"""What each open page shows: the wanted view in, a picture in the scene out; the newest wish
wins."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.app.http_errors import Missing
from palpate.app.scene.annotations import annotations_of
from palpate.app.scene.model_layer import end_of_scale
from palpate.app.scene.picture import Picture, SequenceRenderer
from palpate.app.scene.view import MODELS, Model, Quantity, View
from palpate.app.scene.viewer_scene import PageScene
from palpate.app.scene.viewpoint import Direction, Viewpoint, lookout
from palpate.app.storage.run_store import Run, RunStore
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import PalpateError

if TYPE_CHECKING:
    from palpate.recording.interactive import InteractiveFrame
    from palpate.recording.resolve_frame import ResolvedFrame

__all__ = ["FrameOverride", "InteractiveOverride", "Session", "Sessions"]

log = logging.getLogger(__name__)
MOST_RENDERERS = 6
MOST_SESSIONS = 32


@dataclass(frozen=True, eq=False)
class FrameOverride:
    """A frame solved again that a page shows in place of the extended model's."""

    run: str
    sequence: str
    frame: int
    moment: ResolvedFrame

    def fits(self, view: View, frame: int) -> bool:
        """Whether it is of what this view shows."""
        return (self.run, self.sequence, self.frame) == (view.run, view.sequence, frame)


@dataclass(frozen=True, eq=False)
class InteractiveOverride:
    """What a page shows while a hand leads the tool: the model's answer, in place of one of the
    run's models.
    """

    run: str
    sequence: str
    model: Model
    felt: InteractiveFrame

    def seen(self, view: View) -> View:
        """The view as it is shown: nobody measured this push, so that there is no cloud and no
        error, and no other model.
        """
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
    """One page: its view, the picture of it, and the browsers' scenes that show it."""

    def __init__(
        self,
        identity: str,
        renderer_of: Callable[[str, str], SequenceRenderer],
        end_of: Callable[[str, Quantity], float | None],
    ) -> None:
        self.identity = identity
        self._shown: tuple[View, Picture] | None = None
        self._override: FrameOverride | None = None
        self._touch: InteractiveOverride | None = None
        self._stand: tuple[str, Viewpoint] | None = None
        self._renderer_of, self._end_of = renderer_of, end_of
        self._scenes: list[PageScene] = []
        self._framed: tuple[str, tuple[tuple[float, float, float], ...]] | None = None
        self._lock = threading.Lock()

    @property
    def view(self) -> View | None:
        """What was asked for last and is drawn."""
        return None if self._shown is None else self._shown[0]

    @property
    def picture(self) -> Picture | None:
        """Of that view."""
        return None if self._shown is None else self._shown[1]

    def show(self, view: View) -> dict[str, Any]:
        """Draw this view in all scenes of the page and return what is held now."""
        self._draw(view)
        return self.state()

    def _draw(self, view: View) -> None:
        with self._lock:
            renderer = self._renderer_of(view.run, view.sequence)
            frame = min(view.frame, len(renderer.replay) - 1)
            if self._override is not None and self._override.fits(view, frame):
                renderer = renderer.instead(frame, self._override.moment)
            shown = seen = view.model_copy(update={"frame": frame})
            if self._touch is not None and (self._touch.run, self._touch.sequence) == (
                view.run,
                view.sequence,
            ):
                renderer, seen = (
                    renderer.instead(frame, self._touch.felt, self._touch.model),
                    self._touch.seen(seen),
                )
            picture = renderer.picture(
                seen, self._end_of(seen.run, seen.quantity) if seen.scale == "fixed" else None
            )
            self._shown = (
                shown,
                picture,
            )  # at once: who asks meanwhile is told a view with its own picture
            for scene in self._scenes:
                scene.draw(picture)
            if self._framed != (view.run, picture.columns):
                if self._framed is not None:
                    self._stand = None
                self._look()
            self._framed = (view.run, picture.columns)

    def override_frame(self, override: FrameOverride | None) -> None:
        """Show this in place of the extended model, wherever the page shows that frame; None shows
        the model again.
        """
        with self._lock:
            self._override, view = override, self.view
        if view is not None:
            self._draw(view)

    def touch(self, touch: InteractiveOverride | None) -> None:
        """Show what a hand feels, until None lets go."""
        with self._lock:
            self._touch, view = touch, self.view
        if view is not None:
            self._draw(view)

    def wants_inside(self) -> bool:
        """Whether what is shown cannot be drawn without the inside of the block."""
        view = self.view
        if view is None:
            return False
        lumps = "lump" in view.layers and self._renderer_of(view.run, view.sequence).lumps
        return view.section is not None or view.quantity == "energy" or bool(lumps)

    def look(self, where: Direction = "reset") -> None:
        """Turn the cameras of all scenes to the phantom."""
        with self._lock:
            self._stand = None
            self._look(where)

    def stand(self, run: str, lookout: Viewpoint) -> None:
        """Look from there while this run is shown, as often as a scene opens, until told
        otherwise."""
        with self._lock:
            self._stand = (run, lookout)
            if self.view is not None and self.view.run == run:
                self._look()

    def _look(self, where: Direction = "reset") -> None:
        if self.view is None or self.picture is None:
            return
        replay = self._renderer_of(self.view.run, self.view.sequence).replay
        found = lookout(replay.size, replay.camera("raw").translation, self.picture.columns, where)
        if self._stand is not None and self._stand[0] == self.view.run:
            found = self._stand[1]
        for scene in self._scenes:
            scene.look(found)

    def still(self, width: int, height: int) -> np.ndarray[Any, Any]:
        """What the page's scene shows (height, width, 4); Missing where no browser shows it."""
        with self._lock:
            scenes = list(self._scenes)
        for scene in reversed(scenes):
            found = scene.still(width, height)
            if found is not None:
                return found
        raise Missing(
            "no browser shows this page, so that there is nothing to take a picture of",
            session=self.identity,
        )

    def join(self, scene: PageScene) -> None:
        """A browser's scene was opened: show it what the page shows."""
        with self._lock:
            self._scenes.append(scene)
            if self.view is None or self.picture is None:
                self._framed = None
                return
            self._look()
            scene.draw(self.picture)

    def leave(self, scene: PageScene) -> None:
        """A browser's scene was closed."""
        with self._lock:
            self._scenes = [other for other in self._scenes if other is not scene]

    def state(self) -> dict[str, Any]:
        """The view as held here and counts and a digest of the arrays drawn."""
        shown = self._shown
        if shown is None:
            return {"view": None, "drawn": None, "scenes": len(self._scenes)}
        return {
            "view": shown[0].model_dump(),
            "drawn": shown[1].summary(),
            "scenes": len(self._scenes),
        }


class Sessions:
    """All open pages, the oldest forgotten beyond a few dozen, and the last few sequences looked
    at.
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
        """The session of a page that has shown something, or Missing."""
        with self._lock:
            if identity not in self._sessions:
                raise Missing(f"no page with the id {identity} is open", session=identity)
            return self._sessions[identity]

    def open(self, identity: str) -> Session:
        """The session of a page, made if need be."""
        with self._lock:
            session = self._sessions.pop(identity, None) or Session(
                identity, self.renderer, self.end
            )
            self._sessions[identity] = session
            while len(self._sessions) > MOST_SESSIONS:
                self._sessions.popitem(last=False)
            return session

    def join(self, identity: str, scene: PageScene) -> None:
        """A browser's scene belongs to this page."""
        self.open(identity).join(scene)

    def leave(self, identity: str, scene: PageScene) -> None:
        """A browser's scene is gone."""
        self.open(identity).leave(scene)

    def renderer(self, run: str, sequence: str) -> SequenceRenderer:
        """The sequence of a run, ready to be drawn."""
        with self._lock:
            found = self._runs.get(run)
            key = (run, sequence, found.stamp(sequence))
            renderer = self._renderers.pop(key, None)
            if renderer is None:
                renderer = SequenceRenderer(
                    found.replay(sequence), self._clouds_of(found, sequence), annotations_of(found)
                )
            self._renderers[key] = renderer
            while len(self._renderers) > MOST_RENDERERS:
                self._renderers.popitem(last=False)
            return renderer

    def end(self, run: str, quantity: Quantity) -> float | None:
        """The end of a scale that serves all sequences of a run: the largest of their own; None
        where none holds the quantity.
        """
        key = (run, quantity)
        if key not in self._ends:
            found = self._runs.get(run)
            ends = [end_of_scale(found.replay(sequence), quantity) for sequence in found.sequences]
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
