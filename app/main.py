"""The web application: `create_app(settings)`."""

from __future__ import annotations

import logging
import threading
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse
from fastapi.staticfiles import StaticFiles
from starlette.exceptions import HTTPException

from palpate.app.api import (
    datasets,
    diagnoses,
    disk_space,
    effects,
    evaluations,
    jobs,
    registering,
    registrations,
    replays_and_exports,
    runs,
    sessions,
    sweeps,
    trainings,
    whatif,
)
from palpate.app.api.incoming import imports, looking, looks, uploads
from palpate.app.http_errors import Missing, NoSpace, as_dict, disk_is_full, status_code
from palpate.app.jobs.tasks import TARGETS
from palpate.app.schemas import PROBLEMS, Health
from palpate.app.server import viser_proxy
from palpate.app.server.diagnostics import diagnostics
from palpate.app.server.login import Login
from palpate.app.server.login import router as login_router
from palpate.app.server.request_guard import RequestGuard
from palpate.app.server.tokens import Token
from palpate.app.services import Services
from palpate.app.settings import Settings
from palpate.foundation.errors import PalpateError

__all__ = ["create_app"]

log = logging.getLogger(__name__)
ABOUT = """Replay palpations, find what a simulation gets wrong, and measure the gain.

Lengths are in m, pressures in Pa, times in s. The body of every error is `{kind, message, where}`.
Long tasks are jobs: the answer is 202 and the job. GET /api/jobs/{id}, or the server-sent events of
GET /api/jobs/events, have its progress.
"""

MODULES = (
    datasets,
    imports,
    uploads,
    looks,
    looking,
    disk_space,
    replays_and_exports,
    registrations,
    registering,
    diagnoses,
    jobs,
    runs,
    sessions,
    whatif,
    effects,
    sweeps,
    trainings,
    evaluations,
)


def create_app(settings: Settings, targets: Mapping[str, str] = TARGETS) -> FastAPI:
    """Make the application for one folder of runs and one of datasets.

    Args:
        settings: folders, address and limits.
        targets: function of each kind of job, as "module:function".
    """
    login = Login(Token.load(settings.runs)) if settings.needs_login else None

    def prepare() -> None:
        if app.state.services is None:
            app.state.services = Services.open(settings, dict(targets), partial(_fail, app))

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        prepare()
        yield
        app.state.services.close()
        app.state.services = None

    app = FastAPI(
        title="Palpate",
        version=version("palpate"),
        description=ABOUT,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
    )
    app.state.ending = threading.Event()
    app.state.failure, app.state.stop = "", app.state.ending.set
    app.state.settings, app.state.login = settings, login
    app.state.services, app.state.prepare = None, prepare
    app.add_middleware(RequestGuard, settings=settings, login=login)
    for module in MODULES:
        app.include_router(module.router, prefix="/api", responses=PROBLEMS)
    app.include_router(viser_proxy.router)
    app.include_router(login_router)
    _answer_problems(app)

    _add_health(app, settings)

    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        return FileResponse(settings.static / "index.html", headers={"cache-control": "no-cache"})

    app.mount("/static", StaticFiles(directory=settings.static), name="static")
    return app


def _add_health(app: FastAPI, settings: Settings) -> None:
    """Add what tells whether the server works, and the text for the report of a fault."""

    @app.get("/health", tags=["health"], responses={503: {"model": Health}})
    async def health(response: Response) -> Health:
        """200 where all works, 503 where the job queue does not; the page shows the reason."""
        # async, like the page: it answers also while slow requests take all threads.
        troubled = bool(app.state.services.jobs.trouble)
        response.status_code = 503 if troubled else 200
        return Health(status="troubled" if troubled else "ok")

    @app.get(
        "/api/diagnostics",
        tags=["health"],
        response_class=Response,
        responses={**PROBLEMS, 200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
    )
    def fault_report() -> Response:
        """Versions, machine, settings, the last jobs and the log as a text file, for the report of
        a fault; without data and results.
        """
        text = diagnostics(settings.runs, settings.model_dump(mode="json"))
        headers = {"content-disposition": 'attachment; filename="palpate-diagnostics.txt"'}
        return Response(text, media_type="text/plain", headers=headers)


def _fail(app: FastAPI, reason: str) -> None:
    """End the server, which then exits with the reason."""
    app.state.failure = reason
    app.state.stop()


def _answer_problems(app: FastAPI) -> None:
    @app.exception_handler(PalpateError)
    def problem(_: Request, error: PalpateError) -> JSONResponse:
        return JSONResponse(as_dict(error), status_code=status_code(error))

    @app.exception_handler(RequestValidationError)
    def unreadable(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        body = {
            "kind": "RequestError",
            "message": f"{place}: {first['msg']}",
            "where": {"key": place},
        }
        return JSONResponse(body, status_code=422)

    @app.exception_handler(FileNotFoundError)
    def gone(request: Request, error: FileNotFoundError) -> JSONResponse:
        log.warning("%s %s: a file was gone", request.method, request.url.path, exc_info=error)
        message = f"{request.url.path}: a file of it was deleted while it was read"
        return JSONResponse(as_dict(missing := Missing(message)), status_code=status_code(missing))

    @app.exception_handler(Exception)
    def fault(request: Request, error: Exception) -> JSONResponse:
        if disk_is_full(error):
            return JSONResponse(as_dict(full := NoSpace()), status_code=status_code(full))
        message = (
            f"{request.method} {request.url.path} stopped: {type(error).__name__}: {error}; "
            "the server's log has more"
        )
        return JSONResponse(
            {"kind": "InternalError", "message": message, "where": {}}, status_code=500
        )

    @app.exception_handler(HTTPException)
    def http(request: Request, error: HTTPException) -> JSONResponse:
        message = f"{request.method} {request.url.path}: {error.detail}"
        return JSONResponse(
            {"kind": "HttpError", "message": message, "where": {}}, status_code=error.status_code
        )
