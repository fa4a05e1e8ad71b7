"""Manual registration: draws pairs of points, and finds the points of clicks.

The page stores the pairs, with undo and over reloads.
"""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import numpy as np

from palpate.app.http_errors import Missing
from palpate.app.scene.phantom import Phantom
from palpate.app.scene.registration_picture import Arrow, Mark, PairPicture, middle_of
from palpate.app.scene.registration_scene import PairScene, Ray
from palpate.app.schemas import RegistrationView, WeakDirection
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import PalpateError
from palpate.foundation.frames import Transform
from palpate.registration.picking import pick_cloud, pick_mesh, slide_on_cloud

__all__ = ["ManualRegistration", "ManualRegistrations"]

MOST_SESSIONS = 32
"""Number of pages whose registration is stored."""
APART = 0.03
"""Gap [m] between phantom and cloud side by side."""
SNAP = 14.0
"""Distance from a click within which a landmark is selected [pixel]."""
ARROW = 0.022
"""Half the length of an arrow [m]."""
log = logging.getLogger(__name__)


class ManualRegistration:
    """Manual registration in one page: its view, and the scenes of its browsers."""

    def __init__(self, phantom_of: Callable[[str], Phantom]) -> None:
        self._phantom_of = phantom_of
        self._scenes: list[PairScene] = []
        self._lock = threading.RLock()
        self._listeners: list[Callable[[dict[str, Any]], None]] = []
        self._shown: RegistrationView | None = None
        self._phantom: tuple[str, Phantom] | None = None
        self._start: tuple[tuple[str, str], Transform] | None = None
        self._looked: tuple[str, str, bool] | None = None

    def listen(self, picked: Callable[[dict[str, Any]], None]) -> Callable[[], None]:
        """Call `picked` with each pick, from any thread; returns a function that ends this."""
        self._listeners.append(picked)
        return lambda: self._listeners.remove(picked)

    def show(self, shown: RegistrationView) -> dict[str, Any]:
        """Draw this in all scenes of the page; returns a summary."""
        with self._lock:
            phantom = self._open(shown.dataset)
            self._shown = shown
            picture = self._picture(phantom, shown)
            for scene in self._scenes:
                scene.draw(picture)
            now = (shown.dataset, shown.start, shown.over)
            if now != self._looked:
                self._look(picture)
            self._looked = now
            return self._summary(phantom, shown, picture)

    def look(self) -> None:
        """Turn the cameras to cloud and phantom."""
        with self._lock:
            phantom, shown = self._current()
            self._look(self._picture(phantom, shown))

    def join(self, scene: PairScene) -> None:
        """Add a browser's scene."""
        with self._lock:
            self._scenes.append(scene)
            if self._shown is not None:
                phantom, shown = self._current()
                picture = self._picture(phantom, shown)
                scene.draw(picture)
                scene.look(picture)

    def leave(self, scene: PairScene) -> None:
        """Remove a browser's scene."""
        with self._lock:
            self._scenes = [other for other in self._scenes if other is not scene]

    def click(self, ray: Ray) -> None:
        """Send the point of a click to the page, or the reason why there is none."""
        try:
            with self._lock:
                answer = self.pick(ray) if self._shown is not None else None
        except PalpateError as error:
            answer = {"problem": error.message}
        except Exception:
            log.exception("a click came to nothing")
            return
        for listener in list(self._listeners) if answer else []:
            listener(answer or {})

    def pick(self, ray: Ray) -> dict[str, Any]:
        """The point on the active side under a ray, or the mark under it."""
        with self._lock:
            phantom, shown = self._current()
            side = ray.mark[1] if ray.mark else shown.mode
            if (
                ray.mark is None
                and (chosen := self._mark_under(phantom, shown, ray, side)) is not None
            ):
                return {"chosen": {"pair": chosen, "side": side}}
            hit = (
                self._on_cloud(phantom, shown, ray)
                if side == "cloud"
                else self._on_mesh(phantom, ray)
            )
            if hit is None:
                other = "the phantom" if side == "mesh" else "the cloud"
                return {
                    "problem": f"There is nothing of {other} under this click, "
                    f"and clicks are for {other} now."
                }
            point, landmark = hit
            pair = None if ray.mark is None else ray.mark[0]
            return {
                "picked": {
                    "side": side,
                    "point": [float(x) for x in point],
                    "landmark": landmark,
                    "pair": pair,
                }
            }

    def nudge(self, side: str, point: list[float], right: float, up: float) -> list[float]:
        """The point moved on its surface by this much [m] on the screen; unchanged at an edge."""
        with self._lock:
            phantom, shown = self._current()
            if not self._scenes:
                raise Missing("no scene is open for this page", session=shown.dataset)
            pose = self._pose(phantom, shown)
            start = pose.apply(np.array(point)) if side == "cloud" else np.array(point)
            eye, rightwards, upwards = self._scenes[-1].eye()
            direction = start + right * rightwards + up * upwards - eye
            if side == "mesh":
                hit = pick_mesh(phantom.vertices, phantom.faces, eye, direction)
                return point if hit is None else [float(x) for x in hit]
            moved = slide_on_cloud(pose.apply(phantom.cloud), start, eye, direction)
            return point if moved is None else [float(x) for x in pose.inverse().apply(moved)]

    def _current(self) -> tuple[Phantom, RegistrationView]:
        if self._shown is None:
            raise Missing("this page shows no registration yet")
        return self._open(self._shown.dataset), self._shown

    def _open(self, dataset: str) -> Phantom:
        if self._phantom is None or self._phantom[0] != dataset:
            self._phantom = (dataset, self._phantom_of(dataset))
        return self._phantom[1]

    def _pose(self, phantom: Phantom, shown: RegistrationView) -> Transform:
        """Pose of the drawn cloud: the fit, else the start, shifted aside unless `over` is set."""
        key = (shown.dataset, shown.start)
        if self._start is None or self._start[0] != key:
            self._start = (key, phantom.start(shown.start))
        pose = self._start[1] if shown.pose is None else Transform.from_matrix(shown.pose)
        if shown.over:
            return pose
        low, high = middle_of(pose.apply(phantom.cloud), 0.8 * max(phantom.geometry.size))
        body = phantom.geometry
        level = (body.low[1] + body.high[1] - low[1] - high[1]) / 2
        aside = np.array([body.high[0] + APART - low[0], level, 0.0])
        return Transform(np.eye(3), aside) @ pose

    def _picture(self, phantom: Phantom, shown: RegistrationView) -> PairPicture:
        pose = self._pose(phantom, shown)
        marks, lines = [], []
        for number, pair in enumerate(shown.pairs):
            ends = {}
            for side, point in (("cloud", pair.cloud), ("mesh", pair.mesh)):
                if point is not None:
                    ends[side] = (
                        pose.apply(np.array(point))
                        if side == "cloud"
                        else np.array(point, dtype=float)
                    )
                    marks.append(Mark(number, side, ends[side], shown.chosen == (number, side)))
            if len(ends) == 2:
                lines.append((ends["cloud"], ends["mesh"], number))
        names, (bottom, high) = (
            tuple(phantom.landmarks),
            (phantom.geometry.low, phantom.geometry.high),
        )
        top = np.array([*(bottom + high)[:2] / 2, high[2]])
        return PairPicture(
            cloud=pose.apply(phantom.cloud),
            vertices=phantom.vertices,
            faces=phantom.faces,
            edges=phantom.edges,
            landmarks=np.array([phantom.landmarks[name] for name in names]).reshape(-1, 3),
            names=names,
            marks=tuple(marks),
            arrows=tuple(_arrow(one, top) for one in shown.weak) if shown.over else (),
            over=shown.over,
            lines=tuple(lines),
        )

    def _look(self, picture: PairPicture) -> None:
        for scene in self._scenes:
            scene.look(picture)

    def _mark_under(
        self, phantom: Phantom, shown: RegistrationView, ray: Ray, side: str
    ) -> int | None:
        """Number of the pair whose mark on this side is under the ray."""
        direction = ray.direction / np.linalg.norm(ray.direction)
        for mark in self._picture(phantom, shown).marks:
            arm = mark.place - ray.origin
            if mark.side == side and np.linalg.norm(arm - (arm @ direction) * direction) < 1.2e-3:
                return mark.pair
        return None

    def _on_cloud(
        self, phantom: Phantom, shown: RegistrationView, ray: Ray
    ) -> tuple[FloatArray, None] | None:
        back = self._pose(phantom, shown).inverse()
        row = pick_cloud(
            phantom.cloud, back.apply(ray.origin), back.rotation @ ray.direction, ray.pixel
        )
        if row is None or (
            not shown.over
            and self._behind(phantom, ray, self._pose(phantom, shown).apply(phantom.cloud[row]))
        ):
            return None
        return phantom.cloud[row], None

    def _behind(self, phantom: Phantom, ray: Ray, place: FloatArray) -> bool:
        """Whether the phantom hides a place of the cloud that is shown beside it."""
        hit = pick_mesh(phantom.vertices, phantom.faces, ray.origin, ray.direction)
        return hit is not None and float(np.linalg.norm(hit - ray.origin)) < float(
            np.linalg.norm(place - ray.origin)
        )

    def _on_mesh(self, phantom: Phantom, ray: Ray) -> tuple[FloatArray, str | None] | None:
        hit = pick_mesh(phantom.vertices, phantom.faces, ray.origin, ray.direction)
        direction = ray.direction / np.linalg.norm(ray.direction)
        near: list[tuple[float, str]] = []
        for name, place in phantom.landmarks.items():
            arm = np.array(place) - ray.origin
            along = float(arm @ direction)
            beside = float(np.linalg.norm(arm - along * direction)) / max(along, 1e-9)
            hidden = hit is not None and np.linalg.norm(hit - ray.origin) < along - 6.0e-3
            if beside < SNAP * ray.pixel and not hidden:
                near.append((beside, name))
        if near:
            name = min(near)[1]
            return np.array(phantom.landmarks[name], dtype=float), name
        return None if hit is None else (hit, None)

    def _summary(
        self, phantom: Phantom, shown: RegistrationView, picture: PairPicture
    ) -> dict[str, Any]:
        return {
            "points": len(phantom.cloud),
            "marks": len(picture.marks),
            "arrows": len(picture.arrows),
            "scenes": len(self._scenes),
            "stated": phantom.stated is not None,
            "landmarks": {name: list(place) for name, place in phantom.landmarks.items()},
            "pose": self._pose(phantom, shown).matrix.tolist(),
        }


def _arrow(weak: WeakDirection, pivot: FloatArray) -> Arrow:
    """An arrow along the larger part of a weak direction, of visible length."""
    motion, turn = np.array(weak.translation), np.array(weak.rotation)
    turns = float(np.linalg.norm(turn)) > float(np.linalg.norm(motion))
    axis = turn if turns else motion
    axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
    return Arrow(pivot - ARROW * axis, pivot + ARROW * axis, turns, weak.text)


class ManualRegistrations:
    """The manual registrations of all pages; the least recently used are dropped."""

    def __init__(self, phantom_of: Callable[[str], Phantom]) -> None:
        self._phantom_of = phantom_of
        self._sessions: OrderedDict[str, ManualRegistration] = OrderedDict()
        self._lock = threading.Lock()

    def open(self, page: str) -> ManualRegistration:
        """The registration of a page; a new one if there is none."""
        with self._lock:
            session = self._sessions.pop(page, None) or ManualRegistration(self._phantom_of)
            self._sessions[page] = session
            while len(self._sessions) > MOST_SESSIONS:
                self._sessions.popitem(last=False)
            return session

    def join(self, page: str, scene: PairScene) -> None:
        """Add a browser's scene to a page."""
        self.open(page).join(scene)

    def leave(self, page: str, scene: PairScene) -> None:
        """Remove a browser's scene from a page."""
        self.open(page).leave(scene)

    def click(self, page: str, ray: Ray) -> None:
        """Handle a click in a scene of a page."""
        self.open(page).click(ray)
