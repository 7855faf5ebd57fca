"""The web application: liveness, readiness and metrics.

Holds no state of its own; everything it tells is in the database.
"""

from __future__ import annotations

from fastapi import FastAPI
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST
from sqlalchemy.exc import SQLAlchemyError

from service.doctor import examine_service
from service.settings import Settings
from service.store.engine import Store
from service.web.metrics import metrics_text


def make_app(settings: Settings, store: Store) -> FastAPI:
    """The application for one database and one broker."""
    # The pages that FastAPI brings for its descriptions load scripts from elsewhere.
    app = FastAPI(title="Robomark", docs_url=None, redoc_url=None)

    @app.get("/health/live")
    def live() -> JSONResponse:
        """This process answers; nothing else is looked at."""
        return JSONResponse({"live": True})

    @app.get("/health/ready")
    def ready() -> JSONResponse:
        """Whether submissions would be graded now: 200, or 503 with what is not well."""
        findings = examine_service(settings, store)
        is_ready = all(finding.well for finding in findings)
        checks = {finding.what: {"well": finding.well, "sentence": finding.sentence} for finding in findings}
        return JSONResponse({"ready": is_ready, "checks": checks}, status_code=200 if is_ready else 503)

    @app.get("/metrics")
    def metrics() -> Response:
        """The metrics of the whole service, for Prometheus."""
        try:
            return Response(metrics_text(store), media_type=CONTENT_TYPE_LATEST)
        except SQLAlchemyError:
            return PlainTextResponse("the database does not answer\n", status_code=503)

    return app
