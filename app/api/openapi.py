"""The OpenAPI document: complete enough that a generated client needs no other."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from app.api.schemas.problem import Problem

DESCRIPTION = """
Everything that the browser does goes through these addresses.

* **State and ETag.** `PATCH`, `PUT`, undo and redo need `If-Match` with the ETag of the state that
  they build on: 428 without it, 412 (with the present document as `current`) when somebody else
  was faster. The policy of a dataset alone is replaced without.
* **Problems.** Every answer that is not a success is `application/problem+json` (RFC 9457).
* **Pages.** Lists take `limit` and `cursor`; `next` is the cursor of the next page, `total` says
  how many match.
* **Units.** Pixels of the annotated image size, (0, 0) the centre of the first pixel; metres in
  the pitch frame, z down; degrees.
""".strip()
TAGS = {
    "datasets": "What there is, how far it is, how its numbers are spread, what judges it.",
    "groups": "The views of one instant: the unit of review.",
    "views": "One image of an instant: its lines, its ball, its frame.",
    "stations": "Static cameras, whose lines many views share.",
    "findings": "What a person should look at.",
    "exports": "Datasets as files.",
    "pitch": "Names and shapes of the 26 markings.",
    "health": "For whoever runs the service.",
}


def describe(app: FastAPI) -> None:
    """Replace the framework's own description of errors by ours."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _document(app)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _document(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(
        title=app.title,
        version=app.version,
        summary=app.summary,
        description=DESCRIPTION,
        routes=app.routes,
        tags=[{"name": name, "description": text} for name, text in TAGS.items()],
    )
    schemas = document["components"]["schemas"]
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    problem = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(problem.pop("$defs", {}))
    schemas["Problem"] = problem
    return document
