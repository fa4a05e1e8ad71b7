"""Looks that pages show, drawn in the scenes of their browsers."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from palpate.app.http_errors import Missing
from palpate.app.scene.looks.look_drawing import DrawnLook, LookDrawing
from palpate.app.scene.looks.look_view import LookView
from palpate.app.scene.viewer_scene import PageScene
from palpate.app.scene.viewpoint import Direction, viewpoint_for
from palpate.app.storage.look_store import LookStore

__all__ = ["LookScene", "LookScenes"]

MOST_SESSIONS, MOST_LOOKS = 32, 4
"""Number of pages whose view is stored, and of looks that are kept open."""


class LookScene:
    """The look of one page: its view, and the scenes of its browsers."""

    def __init__(self, drawing_of: Callable[[str], LookDrawing]) -> None:
        self._drawing_of = drawing_of
        self._scenes: list[PageScene] = []
        self._lock = threading.Lock()
        self._shown: tuple[LookDrawing, LookView, DrawnLook] | None = None

    def show(self, view: LookView) -> dict[str, Any]:
        """Draw this in all scenes of the page; returns which cloud it is, and what cannot be
        drawn.
        """
        with self._lock:
            drawing = self._drawing_of(view.look)
            drawn = drawing.drawn(view)
            before = self._shown
            self._shown = (drawing, view, drawn)
            for scene in self._scenes:
                scene.draw(drawn.picture)
            if before is None or (before[1].look, before[2].frame) != (view.look, drawn.frame):
                self._look("reset")
            return {
                "cloud": drawn.cloud,
                "cloud_time": drawn.cloud_time,
                "frame": drawn.frame,
                "counts": drawn.counts,
                "points": drawn.picture.points,
                "cannot": drawn.cannot,
                "figures": sorted(drawn.picture.figures),
                "scenes": len(self._scenes),
            }

    def look(self, where: Direction) -> None:
        """Turn the cameras to what is shown; Missing where nothing is."""
        with self._lock:
            if self._shown is None:
                raise Missing("this page shows no look yet")
            self._look(where)

    def join(self, scene: PageScene) -> None:
        """Add a browser's scene, and draw the page's look in it."""
        with self._lock:
            self._scenes.append(scene)
            if self._shown is not None:
                self._look("reset")
                scene.draw(self._shown[2].picture)

    def leave(self, scene: PageScene) -> None:
        """Remove a browser's scene."""
        with self._lock:
            self._scenes = [other for other in self._scenes if other is not scene]

    def _look(self, where: Direction) -> None:
        if self._shown is None:
            return
        drawing, _, drawn = self._shown
        low, high = drawing.bounds(drawn.frame)
        viewpoint = viewpoint_for(low, high, drawing.eye(drawn.frame), ((0.0, 0.0, 0.0),), where)
        for scene in self._scenes:
            scene.look(viewpoint)


class LookScenes:
    """The looks of all pages; the least recently used are dropped."""

    def __init__(self, store: LookStore) -> None:
        self._store = store
        self._sessions: OrderedDict[str, LookScene] = OrderedDict()
        self._drawings: OrderedDict[str, LookDrawing] = OrderedDict()
        self._lock = threading.Lock()

    def open(self, page: str) -> LookScene:
        """The look of a page; a new one if there is none."""
        with self._lock:
            session = self._sessions.pop(page, None) or LookScene(self.drawing)
            self._sessions[page] = session
            while len(self._sessions) > MOST_SESSIONS:
                self._sessions.popitem(last=False)
            return session

    def join(self, page: str, scene: PageScene) -> None:
        """Add a browser's scene to a page."""
        self.open(page).join(scene)

    def leave(self, page: str, scene: PageScene) -> None:
        """Remove a browser's scene from a page."""
        self.open(page).leave(scene)

    def drawing(self, name: str) -> LookDrawing:
        """A finished look; Missing for another name."""
        with self._lock:
            files = self._store.files(name)
            drawing = self._drawings.pop(name, None) or LookDrawing(files, files.look())
            self._drawings[name] = drawing
            while len(self._drawings) > MOST_LOOKS:
                self._drawings.popitem(last=False)
            return drawing
