"""The inner viser server: listens on a free loopback port only, and tells which page each browser connection belongs to."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from typing import TYPE_CHECKING

from app.lookout import FIELD_OF_VIEW
from app.scene import ViserScene

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer

__all__ = ["Stage"]


class Stage:
    """Owns the viser server. `joined(page, scene)` and `left(page, scene)` are called from its threads."""

    def __init__(self, joined: Callable[[str, ViserScene], None], left: Callable[[str, ViserScene], None]) -> None:
        import viser  # noqa: PLC0415 (heavy)

        with contextlib.redirect_stdout(io.StringIO()):  # it prints its inner address, which is of no use to anybody
            self._server: ViserServer = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self._server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
        self._scenes: dict[int, tuple[str, ViserScene]] = {}
        self._furnish()

        @self._server.on_client_connect
        def _(client: ClientHandle) -> None:
            page, scene = self._page_of(client.client_id), ViserScene(client)
            self._scenes[client.client_id] = (page, scene)
            joined(page, scene)

        @self._server.on_client_disconnect
        def _(client: ClientHandle) -> None:
            entry = self._scenes.pop(client.client_id, None)
            if entry is not None:
                left(*entry)

    @property
    def port(self) -> int:
        """The inner port; only the relay knows it."""
        return int(self._server.get_port())

    def close(self) -> None:
        """Stop the server."""
        self._server.stop()

    def _page_of(self, client_id: int) -> str:
        """The last part of the path the relay connected with (private attributes: pinned to viser 1.1.1)."""
        connection = self._server._websock_server._live_connections[client_id]
        return connection.request.path.strip("/") if connection.request is not None else ""

    def _furnish(self) -> None:
        server = self._server
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.scene.set_up_direction("+z")
        server.scene.configure_environment_map(hdri=None)
        # Mostly ambient light, so that every side shows the colours of the legend; two soft lamps give the shape.
        server.scene.configure_default_lights(False)
        server.scene.add_light_ambient("/lamps/around", intensity=1.9)
        server.scene.add_light_directional("/lamps/above", intensity=1.2, position=(0.1, -0.2, 1.0))
        server.scene.add_light_directional("/lamps/side", intensity=0.7, position=(-1.0, 0.6, 0.4))
        server.scene.add_grid(
            "/table", 0.24, 0.24, cell_size=0.01, section_size=0.05, cell_color=(138, 145, 156), section_color=(128, 135, 146),
            cell_thickness=0.35, section_thickness=0.7, fade_distance=0.6, position=(0.0, 0.0, -0.0004), shadow_opacity=0.0,
        )  # fmt: skip
        server.initial_camera.position = (0.09, -0.17, 0.15)
        server.initial_camera.look_at = (0.0, 0.0, 0.02)
        server.initial_camera.fov = FIELD_OF_VIEW
        server.initial_camera.near = 0.001
