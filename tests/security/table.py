"""The reviewed table of ``routes.yaml``: which attacks each route is given, and why not the others."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import yaml
from fastapi import FastAPI
from pydantic import BaseModel

from app.features.imports.schemas import UploadOrFolder
from app.features.maintenance import routes as maintenance
from app.http.permissions import Permission
from app.http.route import Route
from app.main import PREFIX, ROUTERS

CORPUS = Path(__file__).parent / "corpus"
TABLE = yaml.safe_load((Path(__file__).parent / "routes.yaml").read_text())
MISSING = "99999999"
"""An id that nothing has."""
_MOUNTED = {"/static": "/static/{file}", "/assets/{version}": "/assets/{version}/{file}"}
_SAFE = ("GET", "HEAD")


@dataclass(frozen=True)
class Row:
    """One route of the table.

    Attributes:
        method: As it is asked.
        path: With its parameters in braces.
        kind: Of ``kinds`` in the table.
        role: The least of ``roles`` that may ask it.
        classes: Of attacks that it is given.
    """

    method: str
    path: str
    kind: str
    role: str
    classes: frozenset[str]

    @property
    def changes(self) -> bool:
        """Whether it is asked by a method that may change something."""
        return self.method not in _SAFE

    @property
    def parameters(self) -> list[str]:
        """Names of its path parameters."""
        return re.findall(r"{(\w+)", self.path)

    def target(self, ids: Mapping[str, str], default: str = MISSING) -> str:
        """Its address with these path parameters, and one that is not there for the others."""
        return re.sub(r"{(\w+)[^}]*}", lambda name: ids.get(name[1], default), self.path)

    def __str__(self) -> str:
        return f"{self.method} {self.path}"


def rows(of: str = "") -> list[Row]:
    """The rows that are given a class of attacks; all without one."""
    found = []
    for name, words in TABLE["routes"].items():
        method, path = name.split(" ", 1)
        kind, role, *more = words.split()
        classes = frozenset([*TABLE["kinds"][kind]["classes"], *more])
        found.append(Row(method, _MOUNTED.get(path, path), kind, role, classes))
    return [row for row in found if not of or of in row.classes]


def permissions() -> dict[str, Permission]:
    """Who may ask each route of the application but its pages, as the routes say."""
    return {name: route.permission for name, route in _routes_by_name().items()}


def body_model(row: Row) -> type[BaseModel] | None:
    """The shape of a route's JSON body, where it has one."""
    route = _routes_by_name().get(str(row))
    field = None if route is None else route.body_field
    model = None if field is None else field.field_info.annotation
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None


def places_of_files(model: type[BaseModel], path: str = "") -> list[str]:
    """Where a body names an upload or a folder, by path as permissions write it."""
    found = []
    for name, field in model.model_fields.items():
        for kind in (field.annotation, *get_args(field.annotation)):
            if kind is UploadOrFolder:
                found.append(path + name)
            elif isinstance(kind, type) and issubclass(kind, BaseModel):
                found += places_of_files(kind, f"{path}{name}/")
    return found


def _routes_by_name() -> dict[str, Route]:
    routers = [("", maintenance.health_router), *((PREFIX, router) for router in ROUTERS)]
    return {
        f"{method} {prefix}{route.path}": route
        for prefix, router in routers
        for route in router.routes
        if isinstance(route, Route)
        for method in route.methods
    }


def served(app: FastAPI) -> set[str]:
    """Every route that an application has, mounted folders too, as the table calls them."""
    found = set()
    for path, methods in _routes(app.router):
        found |= {f"{method} {path}" for method in methods - {"HEAD"}}
    return found


def _routes(router: Any, prefix: str = "") -> Iterator[tuple[str, set[str]]]:
    for route in router.routes:
        included = getattr(route, "original_router", None)
        if included is None:
            yield prefix + route.path, set(getattr(route, "methods", None) or {"GET"})
        else:
            yield from _routes(included, prefix + route.include_context.prefix)


def lines_of(name: str) -> list[str]:
    """The lines of a text of the corpus, without its first, which says what it is."""
    return (CORPUS / name).read_text().splitlines()[1:]
