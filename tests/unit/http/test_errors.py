"""Which status belongs to which error, and what the problem says."""

from __future__ import annotations

from typing import Annotated

import pytest
from fastapi import FastAPI, Path, Query
from sqlalchemy.exc import OperationalError
from structlog.testing import capture_logs

from app.errors import (
    ConflictError,
    DatasetFormatError,
    DegenerateGeometryError,
    HeldGroupError,
    ImageError,
    InputError,
    NotFoundError,
    OverloadedError,
    ReviewError,
    SharedStationError,
    StaleRevisionError,
    StorageError,
    TooLargeError,
    UnknownMarkingError,
    UnsafePathError,
)
from app.features.batches.service import Presence
from app.features.groups.edit_schemas import LinesEdit
from app.features.people.schemas import LoginCredentials
from app.http.errors import (
    PreconditionRequiredError,
    StaleStateError,
    find_http_status,
    install_error_handlers,
)


class RefusalError(Exception):
    """Stands for the driver's error inside of SQLAlchemy's."""

    sqlite_errorname = "SQLITE_FULL"


def full_disk() -> StorageError:
    error = StorageError("the disk is full")
    error.__cause__ = OperationalError("INSERT", {}, RefusalError())
    return error


def no_process() -> OverloadedError:
    error = OverloadedError("no process could be started for this")
    error.__cause__ = OSError(12, "Cannot allocate memory")
    return error


SINCE = "2026-11-22T09:00:00Z"
STALE = StaleRevisionError("changed", base_etag='"a"', current_etag='"b"')
CASES: list[tuple[ReviewError, int]] = [
    (InputError("x"), 400),
    (UnknownMarkingError("x"), 400),
    (DatasetFormatError("a", "b", "c", "d"), 400),
    (UnsafePathError("x"), 400),
    (TooLargeError("x"), 413),
    (ImageError("x"), 422),
    (NotFoundError("x"), 404),
    (ConflictError("x"), 409),
    (SharedStationError("cam3", 7, "cam3"), 409),
    (HeldGroupError("bo has this group open", [Presence(7, "bo", SINCE, SINCE)]), 409),
    (STALE, 412),
    (StaleStateError(STALE, "{}"), 412),
    (PreconditionRequiredError("x"), 428),
    (DegenerateGeometryError("x"), 422),
    (StorageError("x"), 503),
    (full_disk(), 507),
    (OverloadedError("x"), 503),
    (no_process(), 503),
]


class TestStatusOf:
    @pytest.mark.parametrize(("error", "status"), CASES, ids=lambda v: str(v)[:20])
    def test_each_branch_of_the_tree_has_its_status(self, error: ReviewError, status: int) -> None:
        assert find_http_status(error) == status


@pytest.fixture
def client(plain_app: FastAPI, client_of):
    @plain_app.get("/raise/{index}")
    def fail(index: int) -> None:
        raise CASES[index][0]

    @plain_app.patch("/lines/{view}")
    def lines(
        view: Annotated[int, Path(ge=1)], edit: LinesEdit, limit: Annotated[int, Query(le=5)] = 1
    ) -> None: ...

    @plain_app.post("/session")
    def log_in(said: LoginCredentials) -> None: ...

    install_error_handlers(plain_app)
    return client_of(plain_app)


class TestReviewErrors:
    @pytest.mark.parametrize("index", range(len(CASES)))
    def test_the_answer_is_a_problem_with_its_sentence_and_an_id(self, client, index: int) -> None:
        error, status = CASES[index]
        answer = client.get(f"/raise/{index}")
        problem = answer.json()
        assert answer.status_code == problem["status"] == status
        assert answer.headers["content-type"] == "application/problem+json"
        assert (problem["detail"], problem["hint"]) == (error.message, error.hint)
        assert problem["instance"].startswith("urn:uuid:")

    def test_a_conflict_carries_the_present_state(self, client) -> None:
        index = next(i for i, (error, _) in enumerate(CASES) if type(error) is StaleStateError)
        answer = client.get(f"/raise/{index}")
        assert (answer.json()["current"], answer.headers["etag"]) == ({}, '"b"')

    def test_a_group_that_somebody_has_open_says_who_and_since_when(self, client) -> None:
        index = next(i for i, (e, _) in enumerate(CASES) if isinstance(e, HeldGroupError))
        assert client.get(f"/raise/{index}").json()["here"] == [{"person": "bo", "since": SINCE}]

    def test_a_static_view_names_its_station(self, client) -> None:
        index = next(i for i, (e, _) in enumerate(CASES) if isinstance(e, SharedStationError))
        assert client.get(f"/raise/{index}").json()["station"] == 7

    def test_a_temporary_failure_says_when_to_ask_again(self, client) -> None:
        for index, (_, status) in enumerate(CASES):
            sent = "retry-after" in client.get(f"/raise/{index}").headers
            assert sent == (status in (503, 507))

    def test_what_the_database_refused_shows_no_sql_and_is_logged_with_its_cause(
        self, client
    ) -> None:
        index = next(i for i, (_, status) in enumerate(CASES) if status == 507)
        with capture_logs() as logs:
            answer = client.get(f"/raise/{index}")
        assert "INSERT" not in answer.text
        assert "RefusalError" in logs[0]["cause"]

    def test_what_is_too_much_at_once_is_logged_where_something_else_is_the_cause(
        self, client
    ) -> None:
        with capture_logs() as logs:
            for index, (error, _) in enumerate(CASES):
                if isinstance(error, OverloadedError):
                    client.get(f"/raise/{index}")
        assert [line["cause"] for line in logs] == ["[Errno 12] Cannot allocate memory"]


class TestValidationErrors:
    def problem(self, client, body: object, path: str = "/lines/1"):
        answer = client.patch(path, json=body)
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.status_code == 422
        return answer.json()

    def test_the_pointer_leads_to_the_field(self, client) -> None:
        problem = self.problem(client, {"lines": {"Middle line": [{"x": 1.0}]}})
        assert problem["pointer"] == "/lines/Middle line/0/y"
        assert problem["detail"].startswith("/lines/Middle line/0/y: is missing")

    @pytest.mark.parametrize(
        ("password", "sentence"),
        [
            ("x" * 201, "/password: must have 200 characters or less"),
            ("", "/password: must have 1 characters or more"),
            (7, "/password: must be a text"),
        ],
        ids=["long", "empty", "number"],
    )
    def test_a_login_is_refused_in_plain_words(self, client, password, sentence) -> None:
        answer = client.post("/session", json={"name": "anna", "password": password})
        assert (answer.status_code, answer.json()["detail"]) == (422, sentence)

    def test_an_unknown_marking_is_named(self, client) -> None:
        problem = self.problem(client, {"lines": {"Midfield/line": None}})
        assert problem["pointer"] == "/lines/Midfield~1line"
        assert '"Midfield/line" is not a pitch marking' in problem["detail"]

    def test_every_field_is_listed(self, client) -> None:
        problem = self.problem(client, {"lines": {"Middle line": [{}]}, "more": 1})
        pointers = {error["pointer"] for error in problem["errors"]}
        assert pointers == {"/lines/Middle line/0/x", "/lines/Middle line/0/y", "/more"}

    def test_the_answer_does_not_repeat_what_was_sent(self, client) -> None:
        assert "<script>" not in str(self.problem(client, {"lines": "<script>"}))

    def test_a_parameter_is_named(self, client) -> None:
        problem = self.problem(client, {"lines": {}}, "/lines/1?limit=9")
        assert problem["pointer"] == "/limit"

    @pytest.mark.parametrize("view", ["0", "x", "-1", "1.5"])
    def test_an_id_that_cannot_be_one_is_not_found(self, client, view: str) -> None:
        answer = client.patch(f"/lines/{view}", json={"lines": {}})
        assert answer.status_code == 404
        assert answer.json()["detail"] == "there is no view with such an id"


class TestNearDatasets:
    def test_the_dataset_that_was_meant_is_offered(self, api) -> None:
        answer = api.get("/api/v1/datasets/brodcast/yield")
        assert answer.status_code == 404
        assert answer.json()["hint"] == 'Did you mean "broadcast"?'
