"""The web application: pages, the API, health checks and metrics.

Apart from rate limits, it keeps no state; all data is in the database. Every module in ``pages`` and ``api`` with a
``router`` is served. A page module's ``cross_site_router`` contains routes that other sites may post to.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache, partial

from fastapi import APIRouter, Depends, FastAPI, Request
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST
from starlette.exceptions import HTTPException

from service.doctor import examine_service
from service.language import translatable
from service.operations import notebook_runs
from service.operations.context import Service, Store
from service.operations.database_errors import DatabaseError
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.settings import Settings
from service.version import GRADER_VERSION
from service.web import api, pages
from service.web.access import check_same_site
from service.web.api_description import build_openapi
from service.web.compression import compress_response
from service.web.context import WebContext
from service.web.ended_runs import EndedRuns
from service.web.errors import add_error_pages
from service.web.metrics import render_metrics
from service.web.rate_limits import RateLimit, RateLimits
from service.web.rendering import load_static_files
from service.web.request_bodies import BodyLimitMiddleware
from service.web.security import SecurityMiddleware


def make_app(settings: Settings, store: Store) -> FastAPI:
    """Return the application for one database and one broker."""
    # FastAPI's own documentation pages are disabled, because they load scripts from other sites.
    app = FastAPI(
        title="Robomark",
        version=GRADER_VERSION,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        routes=list(_collect_routes().routes),
    )
    app.router.redirect_slashes = False
    calls = settings.api_calls_per_minute
    limits = RateLimits(api_calls=RateLimit(round(calls), calls), page_calls=RateLimit(round(calls), calls))
    service = Service(settings, store, Notifier(make_celery(settings), store, settings))
    app.state.context = WebContext(service, limits, EndedRuns(partial(notebook_runs.find_ended, service)))
    app.add_middleware(BodyLimitMiddleware)
    app.add_middleware(SecurityMiddleware, public_url=settings.public_url, probe_hosts=settings.probe_hosts)
    add_error_pages(app)
    _add_probes(app, service)

    @app.get("/static/{name}", include_in_schema=False)
    def static(name: str, request: Request) -> Response:
        """Return a static file. Its name contains its hash, so caches can store it for ever."""
        if name not in load_static_files():
            raise HTTPException(404, translatable("This file does not exist."))
        media_type, data = load_static_files()[name]
        headers = {"cache-control": "public, max-age=31536000, immutable"}
        return compress_response(request, Response(data, media_type=media_type, headers=headers))

    app.openapi = partial(build_openapi, app)  # type: ignore[method-assign]
    return app


@cache
def _collect_routes() -> APIRouter:
    """Return the routes of all modules. They are cached, because creating them takes half a second."""
    all_routes = APIRouter()
    for module in pkgutil.iter_modules(pages.__path__, f"{pages.__name__}."):
        page_module = importlib.import_module(module.name)
        if router := getattr(page_module, "router", None):
            all_routes.include_router(router, dependencies=[Depends(check_same_site)], include_in_schema=False)
        if router := getattr(page_module, "cross_site_router", None):
            all_routes.include_router(router, include_in_schema=False)
    for module in pkgutil.iter_modules(api.__path__, f"{api.__name__}."):
        if router := getattr(importlib.import_module(module.name), "router", None):
            all_routes.include_router(router, prefix="/api/v1")
    return all_routes


def _add_probes(app: FastAPI, service: Service) -> None:
    @app.get("/health/live", include_in_schema=False)
    def live() -> JSONResponse:
        """Report that this process responds, without checking anything else."""
        return JSONResponse({"live": True})

    @app.get("/health/ready", include_in_schema=False)
    def ready() -> JSONResponse:
        """Return 200 if submissions would be graded now, otherwise 503 with the problems."""
        findings = examine_service(service.settings, service.store)
        is_ready = all(finding.well for finding in findings)
        checks_by_name = {finding.what: {"well": finding.well, "sentence": finding.sentence} for finding in findings}
        return JSONResponse({"ready": is_ready, "checks": checks_by_name}, status_code=200 if is_ready else 503)

    @app.get("/metrics", include_in_schema=False)
    def metrics() -> Response:
        """Return the metrics of the whole service for Prometheus."""
        try:
            return Response(render_metrics(service), media_type=CONTENT_TYPE_LATEST)
        except DatabaseError:
            return PlainTextResponse("the database does not respond\n", status_code=503)
