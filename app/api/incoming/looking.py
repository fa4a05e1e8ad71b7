"""The scene of a look in a page."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from palpate.app.scene.looks.look_view import LookView
from palpate.app.scene.viewpoint import Direction
from palpate.app.server.viser_proxy import PageId
from palpate.app.services import CurrentServices

__all__ = ["router"]

router = APIRouter(prefix="/sessions/{page}/looking", tags=["looks"])


@router.post("")
def show(page: PageId, view: LookView, services: CurrentServices) -> dict[str, Any]:
    """Show this time of a look in the scene at /viser/{page}-look. The answer has the number of
    the drawn cloud among the stored ones, its time [s] and its points by reason, and for each
    layer that cannot be drawn the reason.
    """
    return services.look_scenes.open(page).show(view)


@router.post("/view", status_code=204)
def turn(page: PageId, services: CurrentServices, where: Direction = "reset") -> None:
    """Turn the camera to what is shown: from the depth camera's side, the top, the front (along
    +y), or the side (along -x).
    """
    services.look_scenes.open(page).look(where)
