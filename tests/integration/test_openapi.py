"""The OpenAPI document is what the service does: schemathesis finds nothing."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from fastapi import FastAPI
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.config import (
    ChecksConfig,
    GenerationConfig,
    ProjectConfig,
    ProjectsConfig,
    SchemathesisConfig,
)
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation.jsonschema.context import Alphabet
from schemathesis.specs.openapi import _hypothesis as drawing
from schemathesis.specs.openapi import negative

from app.config import Settings
from app.db.store import Store
from app.features.batches.service import NewBatch, make_batch
from app.features.comments.service import add_reply, begin_thread
from app.features.datasets.service import dataset_id
from app.features.exports.jobs import request_export
from app.features.groups.history import read_history
from app.features.groups.submit import load_group_state
from app.features.groups.view_queries import find_group_and_view_ids
from app.features.imports.ingest import import_groups
from app.features.imports.upload_queries import UploadWriter
from app.features.pitches.service import read_pitches
from app.features.policies.service import read_policy
from app.features.predictions.evaluation_run import EvaluationRequest, run_evaluation
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions
from app.features.recordings.ball_runs import BallFollower, add_ball_run, get_ball_run
from app.features.recordings.camera_tracking import TrackedStretch, save_cameras
from app.features.recordings.index import index_recording_in_worker
from app.features.recordings.links import add_link, get_link
from app.features.recordings.service import add_recording
from app.features.recordings.shots import Shot, get_shots, replace_shots
from app.features.solutions.service import solve_dataset
from app.features.stations.service import load_station
from app.features.tracks.service import get_track
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.webhooks.messages import MessageKind
from app.features.webhooks.service import make_webhook, send_ping
from app.formats.report import ReaderReport
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.main import create_app
from app.tracking.ball_run import BallClick
from tests.drawn_balls import place, write_film
from tests.filmed_rigs import filmed_groups
from tests.flights import FIRST, add_flight
from tests.openapi import openapi_of
from tests.tracked_frames import frame
from tests.waiting import SECONDS

EXAMPLES = 5
EVALUATION, DELETED_EVALUATION = "1", "2"
"""Ids of sets of predictions and of evaluations, both."""
EXPORT, DELETED_EXPORT = "1", "2"
"""Exports are the first jobs of the home; what is deleted must not be asked for later."""
DELETED_WEBHOOK = "2"
DELETED_COMMENT = "2"
DELETED_RECORDING = DELETED_LINK = DELETED_RUN = "2"
BALL_CLICKS = [dict(zip("xy", place(frame), strict=True)) | {"frame": frame} for frame in (5, 20)]
"""On the ball of the recording."""
FILMED = "cam1"
"""Camera of groups with pictures, whose ball is followed."""
HOOK = "http://127.0.0.1:9/hook"
"""Where webhooks may be sent, and nobody listens."""
REFUSALS = ["2xx", "400", "404", "409", "412", "422", "428", "503"]
"""What data that fits the schema may still meet: a state that is older, a query that is none."""

SPLIT_ADDRESSES = "/{}\x00"
"""Characters that schemathesis lets no parameter of an address have."""


@pytest.fixture(scope="module", autouse=True)
def _text_of_addresses_fits_them() -> Iterator[None]:
    """What is wrong in an address is drawn from the characters that it can have.

    Schemathesis draws from all and throws away what has one of the others: of names that are too
    long, with hundreds of characters, nearly every one, at most of the cost of this file.
    """

    def of_location(schema: Any, *, location: ParameterLocation, **rest: Any) -> Any:
        with pytest.MonkeyPatch.context() as patch:
            if location is ParameterLocation.PATH:
                fitting = partial(Alphabet, exclude_characters=SPLIT_ADDRESSES)
                patch.setattr(negative, "Alphabet", fitting)
            return negative.negative_schema(schema, location=location, **rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "negative_schema", of_location)
        yield


@pytest.fixture(scope="module")
def application(tmp_path_factory: pytest.TempPathFactory, tree: Path) -> Iterator[FastAPI]:
    """The service over a small dataset."""
    chosen = Settings(
        home=tmp_path_factory.mktemp("openapi"),
        allowed_hosts=["127.0.0.1", "localhost", "testserver"],
        webhooks=[HOOK],
    )
    store = Store.open(chosen)
    import_groups(
        store, "small", read_soccernet_v3(tree, ReaderReport()), source="tree", actor="local"
    )
    solve_dataset(store, "small")
    app = create_app(chosen)
    services = app.state.services
    order = {"dataset": "small", "format": "cameras", "all": True, "boxes": "optimized"}
    for name in (EXPORT, DELETED_EXPORT):
        job = request_export(
            services.jobs,
            store,
            services.exports,
            services.frames,
            {**order, "images": "none"},
            actor="local",
        )
        assert (str(job.id), services.jobs.wait(job.id, 60).state) == (name, "done")
    add_evaluations(store)
    freeze_dataset(store, "small", FreezeRequest("v1", groups="passing"), actor="local")
    for _ in range(2):
        webhook, _secret = make_webhook(store, "small", HOOK, [MessageKind.JUDGED], actor="local")
        send_ping(store, "small", webhook.id, actor="local")
    for name in ("kept", "deleted"):
        make_batch(store, "small", NewBatch(name, skip_given=False), actor="local")
    add_recordings(store, services.balls)
    assert add_flight(store) == 1
    filmed = filmed_groups(chosen.home, 3, FILMED, said=[FIRST])
    import_groups(store, "filmed", filmed, source="films", actor="local")
    talk = begin_thread(store, 1, "Is this the ball?", actor="local")
    add_reply(store, 1, talk.id, "It is.", actor="local")
    yield app
    app.state.services.close()
    store.close()


def add_evaluations(store: Store) -> None:
    """Two sets of predictions and two evaluations; the second of each is there to be deleted."""
    view = load_group_state(store, 1).view_ids.popitem()[0]
    frame = load_group_state(store, 1).group.match + "/" + view
    for name in (EVALUATION, DELETED_EVALUATION):
        path = store.settings.home / "predictions.csv"
        path.write_text(f"image,x,y,w,h,score\n{frame},600,300,{name},9,0.5\n")
        found = add_predictions(store, "small", name, PredictionFiles(path, "csv"), actor="local")
        request = EvaluationRequest(predictions=found.id, groups="all")
        done = run_evaluation(store, "small", request, actor="local")
        assert (str(found.id), str(done.id)) == (name, name)


def add_recordings(store: Store, follower: BallFollower) -> None:
    """One that is indexed and whose ball is followed, and one that is there to be deleted."""
    film = write_film(store.settings.home / "film.avi")
    for path in (film, film.with_name("gone.avi")):
        number = add_recording(store, "small", path, actor="local").id
    assert str(number) == DELETED_RECORDING
    found = index_recording_in_worker(
        store, 1, actor="local", progress=lambda *_: None, stop=lambda: None
    )
    frames = [frame(number, "tracked") for number in range(6)]
    save_cameras(store, found, (0, 5), TrackedStretch(frames, ()), [], "local")
    replace_shots(store, 1, [Shot(0, 19, "replay", "start")], None, actor="local")
    for first in (0, 1):
        number = add_link(store, (1, first, 9), (1, 10, 19), actor="local").id
    assert str(number) == DELETED_LINK
    for click in BALL_CLICKS:
        number = add_ball_run(store, follower, 1, BallClick(**click), actor="local").id
    assert str(number) == DELETED_RUN


@pytest.fixture(scope="module")
def api_schema(application: FastAPI) -> schemathesis.BaseSchema:
    """The document as the service gives it."""
    project = ProjectConfig(
        base_url="http://127.0.0.1",
        request_timeout=SECONDS,
        generation=GenerationConfig(deterministic=True),
        checks=ChecksConfig.from_dict(
            {
                "positive_data_acceptance": {"expected-statuses": REFUSALS},
                # Of what does not fit, some is too large to be looked at (413).
                "negative_data_rejection": {"expected-statuses": ["4xx", "503"]},
            }
        ),
    )
    config = SchemathesisConfig(projects=ProjectsConfig(default=project))
    return schemathesis.openapi.from_asgi("/api/v1/openapi.json", application, config=config)


TAKES = (
    ("GET", "independent-annotation"),
    ("POST", "submission"),
    ("POST", "return"),
    ("POST", "adoption"),
    ("DELETE", "gold"),
    ("PATCH", "gold"),
)
"""Routes about a copy or a gold group."""


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
        if "upload" in path:
            path["upload"] = self.upload()
        if case.method == "DELETE" and "export" in path:
            path["export"] = DELETED_EXPORT
        self.aim_at_webhooks(case)
        self.aim_at_batches(case)
        self.aim_at_words(case)
        self.aim_at_evaluations(case)
        self.aim_at_recordings(case)
        if "against" in (case.query or {}):
            case.query["against"] = 1
        if case.operation.path.endswith("/versions") and case.method == "POST":
            case.body = {"name": "v2", "groups": "passing", "split": {"kind": "given"}}
        if "dataset" in (case.query or {}):
            case.query["dataset"] = "small"
            case.query.pop("cursor", None)
        if isinstance(case.query, dict):
            case.query.pop("q", None)
            case.query.pop("group", None)
        if case.method != "GET":
            case.headers["If-Match"] = self.etag(case)
        case.headers.pop("Idempotency-Key", None)
        if case.operation.path.endswith("/imports"):
            source = {"upload": self.upload()}
            case.body = {"dataset": "small", "format": "soccernet-v3", "source": source}
            case.body |= {"dry_run": True}
        if case.operation.path.endswith("/policy"):
            case.body = {"name": "paper"}
        if case.operation.path.endswith("/pitches") and case.method == "PATCH":
            match = load_group_state(self.store, 1).group.match
            case.body = {"match": match, "length": 105.0, "width": 68.0}
        if case.operation.path.endswith("/pictures") and case.method == "PATCH":
            case.body = {"match": load_group_state(self.store, 1).group.match, "picture": None}
        if case.operation.path.endswith("/datasets/{dataset}/pictures") and case.method == "POST":
            case.body = {}
        if case.operation.path.endswith("/positions") and case.method == "POST":
            case.body = {}
        if case.operation.path.endswith("/positions") and case.method == "DELETE":
            case.query["match"] = load_group_state(self.store, 1).group.match
        if case.operation.path.endswith("/edits"):
            case.body = {"if_match": "*", "items": [{"view": 1, "ball": None}]}
        if case.operation.path.endswith("/exports"):
            case.body = {"dataset": "small", "format": "cameras", "all": True}

    def aim_at_webhooks(self, case: schemathesis.Case) -> None:
        """Those that there are, at the one address that is allowed."""
        if case.method == "DELETE" and "webhook" in case.path_parameters:
            case.path_parameters["webhook"] = DELETED_WEBHOOK
        if case.operation.path.endswith("/webhooks") and case.method == "POST":
            case.body = {"url": HOOK, "kinds": ["job.done"]}
        if case.operation.path.endswith("/{webhook}") and case.method == "PATCH":
            case.body = {"kinds": ["job.done"]}

    def aim_at_batches(self, case: schemathesis.Case) -> None:
        """Those that there are, and stay open."""
        path = case.operation.path
        if case.method == "DELETE" and path.endswith("/batches/{batch}"):
            case.path_parameters["batch"] = "2"
        if case.method == "PATCH" and path.endswith("/batches/{batch}"):
            case.body = {"name": "kept"}
        if case.method == "POST" and path.endswith("/batches"):
            case.body = {"name": "more", "skip_given": False}

    def aim_at_words(self, case: schemathesis.Case) -> None:
        """Comments and entries of the log that there are; the second comment is there to be deleted."""
        path = case.path_parameters
        if "comment" in path:
            # Nobody changes what others have said.
            case.headers.pop("X-Actor", None)
        if case.method == "DELETE" and "comment" in path:
            path["comment"] = DELETED_COMMENT
        if case.operation.path.endswith("/threads") and case.method == "POST":
            case.body = {"text": "one"}
        if "entry" in path:
            path["entry"] = str(read_history(self.store, 1)[0].id)
        if "/audit/" in case.operation.path:
            path["ending"] = "csv"

    def aim_at_evaluations(self, case: schemathesis.Case) -> None:
        """The sets, evaluations and figures that there are."""
        path = case.path_parameters
        if case.method == "DELETE":
            gone = {"predictions": DELETED_EVALUATION, "evaluation": DELETED_EVALUATION}
            path |= {name: value for name, value in gone.items() if name in path}
        if "figure" in path:
            path |= {"figure": "sensitivity", "ending": "json"}
        if "table" in path:
            path |= {"table": "sensitivity", "ending": "json"}
        if case.operation.path.endswith(("/compare", "/comparison")):
            case.query = {"with": 1}
        if case.operation.path.endswith("/frames"):
            case.query.pop("cursor", None)
        if "prediction" in path:
            path["view"] = str([*load_group_state(self.store, 1).view_ids.values()][-1])
        if case.operation.path.endswith("/predictions/accept"):
            case.body = {"dataset": "small", "predictions": 1, "q": "", "dry_run": True}
        if case.operation.path.endswith("/evaluations") and case.method == "POST":
            case.body = {"predictions": 1, "groups": "all"}
        if case.operation.path.endswith("/predictions") and case.method == "POST":
            case.body = {**case.body, "upload": self.upload(), "cameras_upload": None}
            case.body |= {"images_upload": None, "format": "csv", "size": None, "category": None}

    def aim_at_recordings(self, case: schemathesis.Case) -> None:
        """The recording that there is, and frames of it."""
        if case.operation.path.endswith("/{recording}") and case.method == "DELETE":
            case.path_parameters["recording"] = DELETED_RECORDING
        if "link" in case.path_parameters:
            case.path_parameters["link"] = DELETED_LINK if case.method == "DELETE" else "1"
        if "run" in case.path_parameters and case.method == "DELETE":
            case.path_parameters["run"] = DELETED_RUN
        if case.operation.path.endswith("/ball-runs") and case.method == "POST":
            case.body = BALL_CLICKS[0]
        if case.operation.path.endswith("/ball/follow"):
            case.path_parameters["view"], case.body = self.filmed_view(), {"frames": 1}
        if case.operation.path.endswith("/clicks"):
            case.body = BALL_CLICKS[1]
        if case.operation.path.endswith("/{run}") and case.method == "PATCH":
            case.body = {"accepted": False}
        if "/suggestions/" in case.operation.path:
            case.path_parameters["frame"] = "3"
        if case.operation.path.endswith("/links") and case.method == "POST":
            replay = {"recording": 1, "first": 12, "last": 15}
            case.body = {"live": {"first": 0, "last": 5}, "replay": replay}
        if case.operation.path.endswith("/instants"):
            case.body = {"instants": [{"live": 3, "replay": 12}, {"live": 7, "replay": 18}]}
        if case.operation.path.endswith("/recordings") and case.method == "POST":
            case.body = {"dataset": "small", "source": {"upload": self.upload("film.avi")}}
        if case.operation.path.endswith("/tracks") and case.method == "POST":
            case.path_parameters["dataset"], case.body = "flight", {}
        if "track" in case.path_parameters and case.method == "PATCH":
            case.body = {"verdict": "rejected"}
        if case.operation.path.endswith("/shots") and case.method == "PUT":
            case.body = {"shots": [{"first": 0, "last": 5, "kind": "main"}]}
        if case.operation.path.endswith("/{recording}/groups"):
            case.body = {"frames": [1], "propose": False}
        if case.operation.path.endswith("/{recording}/cameras") and case.method == "POST":
            case.body = {"first": 10, "last": 12}
        if "/cameras/{frame}" in case.operation.path:
            case.path_parameters["frame"] = "3"

    def filmed_view(self) -> str:
        """A view of a static camera whose ball the frames after it show."""
        with self.store.read() as session:
            dataset = dataset_id(self.store, "filmed")
            groups = find_group_and_view_ids(session, dataset, [str(FIRST)])
        return str(groups[str(FIRST)][1][FILMED])

    def upload(self, name: str = "predictions.csv") -> str:
        """A file of predictions that fits, or another one of the home."""
        writer = UploadWriter(self.store.settings, name)
        writer.write((self.store.settings.home / name).read_bytes())
        return writer.finish().id

    def etag(self, case: schemathesis.Case) -> str:
        """The present state of what a case changes."""
        if "station" in case.path_parameters:
            return load_station(self.store, 1).etag
        if case.operation.path.endswith("/policy"):
            return read_policy(self.store, "small").etag
        if case.operation.path.endswith("/pitches"):
            return read_pitches(self.store, "small").etag
        if "link" in case.path_parameters:
            return get_link(self.store, 1, 1).etag
        if "run" in case.path_parameters:
            return get_ball_run(self.store, 1, 1).etag
        if "recording" in case.path_parameters:
            return get_shots(self.store, 1).etag
        if "track" in case.path_parameters:
            return get_track(self.store, 1).etag
        return load_group_state(self.store, 1).etag


class TestOperations:
    @pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE])
    def test_each_answers_as_the_document_says(
        self, application: FastAPI, api_schema: schemathesis.BaseSchema, mode: GenerationMode
    ) -> None:
        failed, reached = [], {}
        for found in api_schema.get_all_operations():
            attack, operation = Attack(application.state.services.store), found.ok()
            if operation.path.endswith("/events"):
                # It has no end; tests/unit/http/test_event_routes.py listens to it.
                continue
            try:
                attack.run(operation, mode)
            except Exception as error:
                failed.append(f"{operation.label}: {error!r} {error}")
            reached[operation.label] = attack.statuses
        assert not failed, "\n\n".join(failed)
        if mode is GenerationMode.POSITIVE:
            answered = {200, 201, 202, 204, 409}
            silent = {label for label, found in reached.items() if not found & answered}
            # Only groups of the practice have a lesson; its own tests ask for one.
            silent -= {"GET /api/v1/groups/{group}/lesson"}
            # The group has no finding of a kind by chance; tests of its own dismiss some.
            silent -= {"PUT /api/v1/groups/{group}/dismissal"}
            # Nothing stands still in broadcasts; the rig's own tests have static cameras.
            silent -= {"POST /api/v1/datasets/{dataset}/rig"}
            # Of ordinary groups; own annotations and gold groups have tests of their own.
            silent -= {f"{name} /api/v1/groups/{{group}}/{rest}" for name, rest in TAKES}
            silent -= {f"{verb} /api/v1/groups/{{group}}/adjudication" for verb in ("GET", "POST")}
            silent -= {"POST /api/v1/groups/{group}/adjudication/return"}
            # Of a sample beside its truth, or a version with what people agreed upon.
            silent -= {"POST /api/v1/datasets/{dataset}/gold"}
            silent -= {"POST /api/v1/datasets/{dataset}/guidelines/pictures"}
            silent -= {"GET /api/v1/datasets/{dataset}/guidelines/pictures/{digest}"}
            assert not silent, reached


class TestDocument:
    def test_every_operation_is_named_tagged_and_told(self, application: FastAPI) -> None:
        names = set()
        for path, operations in openapi_of(application)["paths"].items():
            for method, operation in operations.items():
                assert re.fullmatch(r"[a-z][A-Za-z]+", operation["operationId"]), (path, method)
                assert operation["tags"], path
                assert operation["description"], path
                names.add(operation["operationId"])
        assert len(names) == sum(map(len, openapi_of(application)["paths"].values()))

    def test_every_refusal_is_a_problem(self, application: FastAPI) -> None:
        for path, operations in openapi_of(application)["paths"].items():
            for operation in operations.values():
                for status, answer in operation["responses"].items():
                    if int(status) >= 400:
                        assert list(answer["content"]) == ["application/problem+json"], path

    def test_a_change_names_its_precondition_and_its_answer_the_new_state(
        self, application: FastAPI
    ) -> None:
        for path, operations in openapi_of(application)["paths"].items():
            for operation in operations.values():
                names = {parameter["name"] for parameter in operation.get("parameters", [])}
                if "If-Match" in names:
                    assert {"412", "428"} <= set(operation["responses"]), path
                    answers = operation["responses"]
                    assert "ETag" in (answers.get("200") or answers["202"])["headers"], path

    def test_no_schema_of_the_framework_is_left(self, application: FastAPI) -> None:
        schemas = openapi_of(application)["components"]["schemas"]
        assert "Problem" in schemas
        assert not [name for name in schemas if "HTTPValidation" in name or "__" in name]
