"""The inner viser server, on a free loopback port; assigns each browser's scene to its page."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from palpate.app.scene.registration_scene import PairScene, Ray, ViserPairScene
from palpate.app.scene.secret_viser import page_of, secret_viser
from palpate.app.scene.viewer_scene import PageScene, ViserScene
from palpate.app.scene.viewpoint import FIELD_OF_VIEW

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["BY_HAND", "LOOK", "SceneListener", "ViewerServer"]

BY_HAND, LOOK = "-register", "-look"
"""Suffixes of the page's name in connections of manual registration, and of first looks."""
S = TypeVar("S")


@dataclass(frozen=True)
class SceneListener(Generic[S]):
    """Functions to call when a scene of a page opens and when it closes; from the
    viewer's threads.
    """

    joined: Callable[[str, S], None]
    gone: Callable[[str, S], None]

    def join(self, page: str, scene: S) -> Callable[[], None]:
        """Report a new scene; the returned function reports its end."""
        self.joined(page, scene)
        return lambda: self.gone(page, scene)


class ViewerServer:
    """Owns the viser server.

    Args:
        show: is called for scenes of a page's replays.
        looks: is called for scenes of first looks.
        pairs: is called for scenes of manual registration.
        clicked: is called with each click in the latter.

    Attributes:
        secret: first part of the path of the relay's connections.
    """

    def __init__(
        self,
        show: SceneListener[PageScene],
        looks: SceneListener[PageScene],
        pairs: SceneListener[PairScene],
        clicked: Callable[[str, Ray], None],
    ) -> None:
        self._server, self.secret = secret_viser()
        # A browser may close while its scene is drawn; this is harmless.
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
        self._server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
        self._left: dict[int, Callable[[], None]] = {}
        self._set_up_scene()

        @self._server.on_client_connect
        def _(client: ClientHandle) -> None:
            page = page_of(self._server, client.client_id)
            if page.endswith(BY_HAND):
                page = page.removesuffix(BY_HAND)
                self._left[client.client_id] = pairs.join(
                    page, ViserPairScene(client, lambda ray: clicked(page, ray))
                )
            elif page.endswith(LOOK):
                page = page.removesuffix(LOOK)
                self._left[client.client_id] = looks.join(page, ViserScene(client))
            else:
                self._left[client.client_id] = show.join(page, ViserScene(client))

        @self._server.on_client_disconnect
        def _(client: ClientHandle) -> None:
            left = self._left.pop(client.client_id, None)
            if left is not None:
                left()

    @property
    def port(self) -> int:
        """The inner port; only the relay uses it."""
        return int(self._server.get_port())

    def close(self) -> None:
        """Stop the server."""
        self._server.stop()

    def _set_up_scene(self) -> None:
        server = self._server
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.scene.set_up_direction("+z")
        server.scene.configure_environment_map(hdri=None)
        # Mostly ambient light, so that every side has the colours of the legend; two directional
        # lamps show the shape.
        server.scene.configure_default_lights(False)
        server.scene.add_light_ambient("/lamps/around", intensity=1.9)
        server.scene.add_light_directional("/lamps/above", intensity=1.2, position=(0.1, -0.2, 1.0))
        server.scene.add_light_directional("/lamps/side", intensity=0.7, position=(-1.0, 0.6, 0.4))
        server.scene.add_grid(
            "/table",
            0.24,
            0.24,
            cell_size=0.01,
            section_size=0.05,
            cell_color=(138, 145, 156),
            section_color=(128, 135, 146),
            cell_thickness=0.35,
            section_thickness=0.7,
            fade_distance=0.6,
            position=(0.0, 0.0, -0.0004),
            shadow_opacity=0.0,
        )
        server.initial_camera.position = (0.09, -0.17, 0.15)
        server.initial_camera.look_at = (0.0, 0.0, 0.02)
        server.initial_camera.fov = FIELD_OF_VIEW
        server.initial_camera.near = 0.001
