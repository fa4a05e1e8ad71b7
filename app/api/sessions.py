"""Views of open pages: over a websocket, or request by request."""

from __future__ import annotations

from io import BytesIO
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, Response, WebSocket
from pydantic import ValidationError

from palpate.app.drawing.colours import palette
from palpate.app.drawing.view import Camera, View
from palpate.app.http_errors import as_dict
from palpate.app.scene.viewpoint import Direction, Viewpoint
from palpate.app.server.newest_wins import newest_wins
from palpate.app.server.viser_proxy import PageId
from palpate.app.services import CurrentServices
from palpate.foundation.errors import PalpateError

__all__ = ["router"]

router = APIRouter(tags=["scene"])
Pixels = Annotated[int, Query(ge=16, le=4096)]


@router.get("/palette")
def colours() -> dict[str, Any]:
    """Colours of all things, and the colour maps."""
    return palette()


@router.post("/sessions/{page}/view")
def show(page: PageId, view: View, services: CurrentServices) -> dict[str, Any]:
    """Show this view."""
    return services.sessions.open(page).show(view)


@router.post("/sessions/{page}/look", status_code=204)
def look(page: PageId, services: CurrentServices, where: Direction = "reset") -> None:
    """Turn the camera to the phantom: the depth camera's view, or from the top, the front (along
    +y), the side (along -x).
    """
    services.sessions.get(page).look(where)


@router.put("/sessions/{page}/camera", status_code=204)
def stand(page: PageId, camera: Camera, services: CurrentServices) -> None:
    """Look at a run from a chosen place, also in scenes of the page that open later."""
    place, target = np.array(camera.position), np.array(camera.target)
    services.sessions.open(page).look_from(
        camera.run, Viewpoint(place, target, np.array([0.0, 0.0, 1.0]))
    )


@router.get(
    "/sessions/{page}/still.png",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}}},
)
def still(
    page: PageId, services: CurrentServices, width: Pixels = 1280, height: Pixels = 720
) -> Response:
    """The page's scene as its browser renders it, with a transparent background; 404 where no
    browser shows it.
    """
    from PIL import Image

    stream = BytesIO()
    Image.fromarray(services.sessions.get(page).still(width, height)).save(
        stream, "PNG", compress_level=1
    )
    return Response(
        stream.getvalue(), media_type="image/png", headers={"cache-control": "no-store"}
    )


@router.get("/sessions/{page}/state")
def state(page: PageId, services: CurrentServices) -> dict[str, Any]:
    """The view of a page, with counts and a digest of the arrays drawn."""
    return services.sessions.get(page).state()


@router.websocket("/sessions/{page}/socket")
async def socket(websocket: WebSocket, page: PageId, services: CurrentServices) -> None:
    """Receive views, send states. Views that arrive while one is being drawn replace each other."""
    await newest_wins(websocket, lambda text: _answer(services, page, text))


def _answer(services: CurrentServices, page: str, text: str) -> dict[str, Any]:
    try:
        return services.sessions.open(page).show(View.model_validate_json(text))
    except ValidationError as error:
        return {
            "problem": {"kind": "RequestError", "message": error.errors()[0]["msg"], "where": {}}
        }
    except PalpateError as error:
        return {"problem": as_dict(error)}
