"""The OpenAPI document of an application of a test, described once in a process: each is of the same routes."""

from __future__ import annotations

import json
from typing import Any

from fastapi import FastAPI

from app.http.route import list_routes

_documents: dict[tuple[str, ...], str] = {}


def openapi_of(app: FastAPI) -> dict[str, Any]:
    """A document of its own for who asks, as ``GET /api/v1/openapi.json`` answers."""
    routes = tuple(path for path, _ in list_routes(app))
    if routes not in _documents:
        _documents[routes] = json.dumps(app.openapi())
    document: dict[str, Any] = json.loads(_documents[routes])
    return document
