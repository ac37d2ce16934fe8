"""The OpenAPI document is what the service does: schemathesis finds nothing."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import schemathesis
from fastapi import FastAPI
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.config import (
    ChecksConfig,
    GenerationConfig,
    PositiveDataAcceptanceConfig,
    ProjectConfig,
    ProjectsConfig,
    SchemathesisConfig,
)

from app.api.application import create_app
from app.config import Settings
from app.datasets.report import Report
from app.datasets.soccernet_v3 import read_soccernet_v3
from app.review.export import export
from app.review.ingest import ingest
from app.review.recompute import solve_dataset
from app.review.stations import load_station
from app.review.submit import load
from app.store.session import Store

EXAMPLES = 5
KEY = "an-export"
EXPORT = hashlib.sha256(KEY.encode()).hexdigest()[:32]
REFUSALS = ["2xx", "400", "404", "409", "412", "422", "428", "429"]
"""What data that fits the schema may still meet: a state that is older, a query that is none."""


@pytest.fixture(scope="module")
def application(tmp_path_factory: pytest.TempPathFactory, tree: Path) -> Iterator[FastAPI]:
    """The service over a small dataset."""
    chosen = Settings(
        home=tmp_path_factory.mktemp("openapi"),
        allowed_hosts=["127.0.0.1", "localhost", "testserver"],
    )
    store = Store.open(chosen)
    ingest(store, "small", read_soccernet_v3(tree, Report()), source="tree", actor="local")
    solve_dataset(store, "small")
    app = create_app(chosen)
    app.state.services.exports.make(
        {"dataset": "small", "format": "cameras"},
        KEY,
        lambda path: export(store, "small", "cameras", path, everything=True),
    )
    yield app
    app.state.services.close()
    store.close()


@pytest.fixture(scope="module")
def api_schema(application: FastAPI) -> schemathesis.BaseSchema:
    """The document as the service gives it."""
    project = ProjectConfig(
        base_url="http://127.0.0.1",
        generation=GenerationConfig(deterministic=True),
        checks=ChecksConfig(
            positive_data_acceptance=PositiveDataAcceptanceConfig(expected_statuses=REFUSALS)
        ),
    )
    config = SchemathesisConfig(projects=ProjectsConfig(default=project))
    return schemathesis.openapi.from_asgi("/api/v1/openapi.json", application, config=config)


class Attack:
    """Sends cases of one operation and holds every answer against the document."""

    def __init__(self, store: Store):
        self.store = store
        self.statuses: set[int] = set()

    def run(self, operation: schemathesis.APIOperation, mode: GenerationMode) -> None:
        """Send a bounded number of cases, the same ones every time."""

        @given(case=operation.as_strategy(generation_mode=mode))
        @settings(
            max_examples=EXAMPLES,
            deadline=None,
            derandomize=True,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        def one(case: schemathesis.Case) -> None:
            if mode is GenerationMode.POSITIVE:
                self.aim(case)
            self.statuses.add(case.call_and_validate().status_code)

        # Operations without parameters have no case that does not fit.
        with suppress(Unsatisfiable):
            one()

    def aim(self, case: schemathesis.Case) -> None:
        """Name what exists, so that the cases get beyond 404 and 428."""
        path = case.path_parameters
        for name in path:
            path[name] = {"dataset": "small", "export": EXPORT}.get(name, "1")
        if "dataset" in (case.query or {}):
            case.query["dataset"] = "small"
            case.query.pop("cursor", None)
        if isinstance(case.query, dict):
            case.query.pop("q", None)
            case.query.pop("group", None)
        case.headers["If-Match"] = self.etag(case)
        case.headers.pop("Idempotency-Key", None)
        if case.operation.path.endswith("/exports"):
            case.body = {"dataset": "small", "format": "cameras", "all": True}

    def etag(self, case: schemathesis.Case) -> str:
        """The present state of what a case changes."""
        if "station" in case.path_parameters:
            return load_station(self.store, 1).etag
        return load(self.store, 1).etag


class TestOperations:
    @pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE])
    def test_each_answers_as_the_document_says(
        self, application: FastAPI, api_schema: schemathesis.BaseSchema, mode: GenerationMode
    ) -> None:
        failed, reached = [], {}
        for found in api_schema.get_all_operations():
            attack, operation = Attack(application.state.services.store), found.ok()
            try:
                attack.run(operation, mode)
            except Exception as error:
                failed.append(f"{operation.label}: {error!r} {error}")
            reached[operation.label] = attack.statuses
        assert not failed, "\n\n".join(failed)
        if mode is GenerationMode.POSITIVE:
            silent = {label for label, found in reached.items() if not found & {200, 201, 409}}
            assert not silent, reached


class TestDocument:
    def test_every_operation_is_named_tagged_and_told(self, application: FastAPI) -> None:
        names = set()
        for path, operations in application.openapi()["paths"].items():
            for method, operation in operations.items():
                assert re.fullmatch(r"[a-z][A-Za-z]+", operation["operationId"]), (path, method)
                assert operation["tags"], path
                assert operation["description"], path
                names.add(operation["operationId"])
        assert len(names) == sum(map(len, application.openapi()["paths"].values()))

    def test_every_refusal_is_a_problem(self, application: FastAPI) -> None:
        for path, operations in application.openapi()["paths"].items():
            for operation in operations.values():
                for status, answer in operation["responses"].items():
                    if int(status) >= 400:
                        assert list(answer["content"]) == ["application/problem+json"], path

    def test_a_change_names_its_precondition_and_its_answer_the_new_state(
        self, application: FastAPI
    ) -> None:
        for path, operations in application.openapi()["paths"].items():
            for operation in operations.values():
                names = {parameter["name"] for parameter in operation.get("parameters", [])}
                if "If-Match" in names:
                    assert {"412", "428"} <= set(operation["responses"]), path
                    assert "ETag" in operation["responses"]["200"]["headers"], path

    def test_no_schema_of_the_framework_is_left(self, application: FastAPI) -> None:
        schemas = application.openapi()["components"]["schemas"]
        assert "Problem" in schemas
        assert not [name for name in schemas if "HTTPValidation" in name or "__" in name]
