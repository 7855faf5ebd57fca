"""A page that documents the API, generated from the OpenAPI document."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.web.access import OptionalReader
from service.web.rendering import render_page

router = APIRouter()


@router.get("/api")
def show_api(request: Request, reader: OptionalReader) -> Response:
    """Show the routes of the API by subject."""
    subjects: dict[str, list[tuple[str, str, str]]] = {}
    for path, operations in request.app.openapi()["paths"].items():
        for method, operation in operations.items():
            route = (method.upper(), path, operation["description"])
            subjects.setdefault(operation["tags"][0], []).append(route)
    return render_page(request, reader, "api.html", subjects=subjects)
