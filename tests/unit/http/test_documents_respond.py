"""A server that is stopped between the commit of the work and the end of the answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from starlette.responses import Response
from structlog.testing import capture_logs

from app.db.session import Session, pending_response
from app.db.store import Store
from app.features.imports import upload_queries as uploads
from app.features.independent_annotations.service import begin_annotation
from app.http import idempotency
from app.http.deps import Services
from app.http.documents import make_empty_response, respond_with
from tests.databases import content
from tests.openapi import openapi_of
from tests.unit.http import dataset_requests, group_requests
from tests.unit.http.group_requests import API, Made, Request, ball, store_of, verdict

KEY = {"Idempotency-Key": "one"}
KEPT: dict[str, Made] = {
    "acceptNoise": dataset_requests.noise,
    "acceptPrediction": dataset_requests.accepted_one,
    "acceptPredictions": dataset_requests.accepted,
    "acceptPredictions of views": dataset_requests.accepted_at_once,
    "addGuidelinePicture": dataset_requests.guideline_picture,
    "addLink": dataset_requests.link,
    "addPredictions": dataset_requests.predictions,
    "adjustRig": dataset_requests.rig,
    "adoptIndependentAnnotation": group_requests.adoption,
    "beginIndependentAnnotation": group_requests.take,
    "beginThread": group_requests.thread,
    "cancelJob": dataset_requests.cancelled,
    "changeBatch": dataset_requests.batch_edited,
    "changeComment": group_requests.comment_edited,
    "changeRecording": dataset_requests.match_clock,
    "changeStation": group_requests.station_calibration,
    "changeThread": group_requests.thread_resolved,
    "changeView": group_requests.left_out,
    "chooseGoldGroups": dataset_requests.gold_choice,
    "createSavedView": dataset_requests.saved_view,
    "decideAdjudication": group_requests.adjudication,
    "deleteBatch": dataset_requests.no_batch,
    "deleteComment": group_requests.comment_deleted,
    "deleteDataset": dataset_requests.no_dataset,
    "deleteEvaluation": dataset_requests.no_evaluation,
    "deleteExport": dataset_requests.no_export,
    "deleteLink": dataset_requests.no_link,
    "deletePredictions": dataset_requests.no_predictions,
    "deleteRecording": dataset_requests.no_recording,
    "deleteSavedView": dataset_requests.no_saved_view,
    "dismissFinding": group_requests.dismissal,
    "editViews": group_requests.bulk_edits,
    "estimateMatchPictures": dataset_requests.estimate,
    "estimatePitches": dataset_requests.pitch_estimates,
    "findShots": dataset_requests.found_shots,
    "forgetDatasetProposals": dataset_requests.no_proposals,
    "freezeVersion": dataset_requests.freeze,
    "returnForCorrection": group_requests.adjudication_back,
    "returnGroup": group_requests.returned_group,
    "returnIndependentAnnotation": group_requests.take_handed_back,
    "submitGroup": group_requests.submitted,
    "submitIndependentAnnotation": group_requests.take_handed_in,
    "linkByBall": dataset_requests.ball_link,
    "makeBatch": dataset_requests.batch,
    "makeExport": dataset_requests.export,
    "changeGold": group_requests.gold_start,
    "markGold": group_requests.gold,
    "proposeDatasetLines": dataset_requests.proposals,
    "markNotificationsRead": dataset_requests.bell,
    "readDatasetPaint": dataset_requests.paint,
    "redoGroup": group_requests.redo,
    "redoStation": group_requests.station_redo,
    "redoVerdictBatch": dataset_requests.bulk_redone,
    "replyToThread": group_requests.comment,
    "setAgreementLimits": dataset_requests.limits,
    "setInstants": dataset_requests.linked_instants,
    "setMatchPicture": dataset_requests.match_picture,
    "setPitch": dataset_requests.pitch,
    "setPolicy": dataset_requests.policy,
    "setShots": dataset_requests.shots,
    "setStationLines": group_requests.station_lines,
    "setVerdict": group_requests.verdict,
    "setVerdicts": dataset_requests.bulk,
    "setViewBall": group_requests.ball,
    "setViewLines": group_requests.lines,
    "sharePositions": dataset_requests.positions,
    "solveDataset": dataset_requests.solving,
    "startEvaluation": dataset_requests.evaluation,
    "startImport": dataset_requests.data_import,
    "startPractice": dataset_requests.practice,
    "startRecordingPractice": dataset_requests.recording_practice,
    "revertDatasetPaint": dataset_requests.no_paint,
    "changeTrack": dataset_requests.track_verdict,
    "makeTracks": dataset_requests.tracks,
    "takeInstants": dataset_requests.instants,
    "trackCameras": dataset_requests.tracked_cameras,
    "followBall": dataset_requests.ball_click,
    "mendBallRun": dataset_requests.another_ball_click,
    "deleteBallRun": dataset_requests.no_ball_run,
    "turnCameras": dataset_requests.turned_cameras,
    "withdrawSubmission": group_requests.hand_in_taken_back,
    "revertNoise": dataset_requests.no_noise,
    "revertPositions": dataset_requests.no_positions,
    "revertRig": dataset_requests.no_rig,
    "undoGroup": group_requests.undo,
    "undoStation": group_requests.station_undo,
    "undoVerdictBatch": dataset_requests.bulk_undone,
    "unmarkGold": group_requests.no_gold,
    "verifyVersion": dataset_requests.verification,
    "writeGuidelines": dataset_requests.guidelines,
}
"""Operations whose answer is in the transaction of their work; where one has several ways, a word
behind its name tells them apart."""
HARMLESS = {
    "changeBallRun": "It is written down before any ball is set: the rest is done, and the answer the same.",
    "addRecording": "The same file again is the same recording, and is indexed once more.",
    "changeTeam": "The same setting once more changes nothing, and has the same answer.",
    "clearMaintenance": "A notice that is taken away is away.",
    "deleteUpload": "It is written down before what goes: the rest is done, and the answer the same.",
    "releaseGroup": "A lease that has ended is ended.",
    "followBallOfView": "Saves nothing.",
    "previewGroup": "Saves nothing.",
    "proposeLines": "Saves nothing.",
    "readPaint": "Saves nothing.",
    "sendPart": "Bytes that are here already are passed over.",
    "setMaintenance": "The same notice once more is the same notice.",
    "setMemberRole": "The same role once more changes nothing, and has the same answer.",
    "openGroup": "A lease that one has lasts on.",
    "openNextGroup": "A lease is a courtesy: one that nobody uses ends after three minutes.",
    "tryPolicy": "Saves nothing.",
    "uploadFile": "The same file again is the same upload.",
}
"""Operations that are done again after a stop, and why nothing comes of that."""


@contextmanager
def stopped_after_a_commit(
    store: Store, patch: pytest.MonkeyPatch, *, commits: int = 1
) -> Iterator[None]:
    """Whatever commits first, or as the last of so many, never comes back."""
    plain, left = store.write, iter(range(commits - 1))

    @contextmanager
    def write(**options: Any) -> Iterator[Session]:
        with plain(**options) as session:
            yield session
        if next(left, None) is None:
            raise SystemError("stopped")

    with patch.context() as patched, capture_logs():
        patched.setattr(store, "write", write)
        yield


class TestTable:
    def test_every_operation_that_takes_a_key_is_in_one_of_the_tables(self, app) -> None:
        keyed = [
            operation["operationId"]
            for operations in openapi_of(app)["paths"].values()
            for operation in operations.values()
            if "Idempotency-Key" in [item["name"] for item in operation["parameters"]]
        ]
        kept = {name.partition(" ")[0] for name in KEPT}
        assert sorted(keyed) == sorted([*kept, *HARMLESS])


class TestStopped:
    @pytest.fixture(autouse=True)
    def _as_it_was(self, app) -> Iterator[None]:
        yield
        app.dependency_overrides.clear()

    @pytest.mark.parametrize("operation", KEPT)
    def test_sent_again_it_gets_the_answer_and_is_not_done_again(
        self, app, api, monkeypatch: pytest.MonkeyPatch, operation: str
    ) -> None:
        method, path, body, headers = KEPT[operation](api)

        def send(key: dict[str, str] = KEY) -> Any:
            return api.request(method, f"{API}{path}", json=body, headers={**headers, **key})

        before = content(app.state.services.store)
        with stopped_after_a_commit(app.state.services.store, monkeypatch):
            assert send().status_code == 500
        app.state.services.close()
        app.state.services = Services.open(app.state.services.settings)
        work = content(app.state.services.store)
        assert work != before
        again = send()
        assert (again.status_code // 100, again.headers["idempotency-replayed"]) == (2, "true")
        assert content(app.state.services.store) == work
        assert send().content == again.content

    def test_of_predictions_in_named_views_what_is_sent_is_what_was_kept(self, api) -> None:
        method, path, body, _ = dataset_requests.accepted_at_once(api)
        first, again = (
            api.request(method, f"{API}{path}", json=body, headers=KEY) for _ in range(2)
        )
        assert (first.json()["changed"], again.headers["idempotency-replayed"]) == (1, "true")
        assert first.content == again.content

    def test_the_answer_is_the_one_that_would_have_been_sent(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        method, path, body, headers = ball(api)
        with stopped_after_a_commit(app.state.services.store, monkeypatch):
            api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        again = api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        now = api.get(f"{API}/groups/1")
        assert again.content == now.content
        for name in ("etag", "content-type", "cache-control"):
            assert again.headers[name] == now.headers[name]

    def test_what_is_rolled_back_has_no_answer(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        method, path, body, headers = verdict(api)
        with monkeypatch.context() as patched, capture_logs():
            patched.setattr(Session, "commit", lambda _: (_ for _ in ()).throw(SystemError("full")))
            send = api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
            assert send.status_code == 500
        again = api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        assert (again.status_code, "idempotency-replayed" in again.headers) == (200, False)


@contextmanager
def stopped_at(name: str, patch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whoever calls a function of the store of uploads never comes back."""

    def stop(_path: Path) -> None:
        raise SystemError("stopped")

    with patch.context() as patched, capture_logs():
        patched.setattr(uploads, name, stop)
        yield


class TestUpload:
    """What goes is no row, and is gone in several steps: the server is stopped between any two."""

    @pytest.mark.parametrize("step", ["written down", "moved", "removed", "answered"])
    def test_one_that_was_being_deleted_is_gone_and_the_answer_the_same(
        self, app, api, monkeypatch: pytest.MonkeyPatch, step: str
    ) -> None:
        store = app.state.services.store
        stops = {
            "written down": stopped_after_a_commit(store, monkeypatch),
            "moved": stopped_at("delete_path", monkeypatch),
            "removed": stopped_at("sync_to_disk", monkeypatch),
            "answered": stopped_after_a_commit(store, monkeypatch, commits=2),
        }
        path = f"{API}/uploads/{dataset_requests.uploaded(api, 'a.csv', b'a')}"
        with stops[step]:
            assert api.delete(path, headers=KEY).status_code == 500
        again = [api.delete(path, headers=KEY) for _ in range(2)]
        assert [answer.status_code for answer in again] == [204, 204]
        assert again[1].headers["idempotency-replayed"] == "true"
        assert api.get(path).status_code == 404

    def test_one_that_is_sent_once_more_meanwhile_stays(
        self, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = f"{API}/uploads/{dataset_requests.uploaded(api, 'a.csv', b'a')}"
        with stopped_at("sync_to_disk", monkeypatch):
            assert api.delete(path, headers=KEY).status_code == 500
        dataset_requests.uploaded(api, "a.csv", b"a")
        assert api.delete(path, headers=KEY).status_code == 204
        assert api.get(path).status_code == 200

    def test_one_that_is_not_there_is_refused_under_any_key(self, api) -> None:
        path = f"{API}/uploads/{dataset_requests.uploaded(api, 'a.csv', b'a')}"
        told = [api.delete(path, headers={"Idempotency-Key": key}) for key in ("one", "two", "two")]
        assert [answer.status_code for answer in told] == [204, 404, 404]


def dataset_with_a_copy(api: Any) -> Request:
    """A dataset goes with the annotations that people made of its groups on their own."""
    request = dataset_requests.no_dataset(api)
    dataset = api.get(f"{API}/datasets/demo").json()["id"]
    (group,) = api.get(f"{API}/groups/ids", params={"dataset": dataset}).json()["ids"]
    begin_annotation(store_of(api), group, person="ann")
    return request


class TestInnerWork:
    """Services that other services use, each of which could answer a request of its own."""

    @pytest.mark.parametrize(
        "made",
        [
            dataset_with_a_copy,
            dataset_requests.accepted_at_once,
            dataset_requests.bulk,
            dataset_requests.no_rig,
            group_requests.adjudication,
            group_requests.adoption,
            group_requests.bulk_edits,
            group_requests.submitted,
            group_requests.station_lines,
        ],
    )
    def test_the_response_is_of_the_whole_and_stored_with_the_last_of_it(
        self, api, monkeypatch: pytest.MonkeyPatch, made: Made
    ) -> None:
        method, path, body, headers = made(api)
        # As where the server stops once the work is done.
        monkeypatch.setattr(idempotency, "store_sent_response", lambda *_: None)
        first, again = (
            api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
            for _ in range(2)
        )
        assert first.status_code // 100 == 2
        assert again.headers["idempotency-replayed"] == "true"
        assert (again.status_code, again.content) == (first.status_code, first.content)


class TestResponds:
    def test_a_route_gives_its_parameters_to_what_makes_the_response(self) -> None:
        @respond_with(lambda outcome, status: Response(outcome, status), "status")
        def route(name: str, status: int) -> str:
            return name

        answer = route(name="ann", status=202)
        assert (answer.body, answer.status_code) == (b"ann", 202)

    def test_a_response_that_a_route_makes_itself_is_sent_as_it_is(self) -> None:
        made = Response(b"planned")

        @respond_with(make_empty_response)
        def route() -> Response:
            return made

        assert route() is made

    def test_a_coroutine_is_refused_as_it_shares_its_thread(self) -> None:
        async def route() -> None:
            """Does nothing."""

        with pytest.raises(AssertionError):
            respond_with(make_empty_response)(route)

    def test_what_follows_a_response_has_no_request_to_answer(self) -> None:
        seen: list[bool] = []

        @respond_with(make_empty_response)
        def route() -> None:
            seen.append(pending_response.get() is not None)

        route()
        assert (seen, pending_response.get()) == ([True], None)


class TestCost:
    @pytest.mark.parametrize(("route", "most"), [(ball, 16), (verdict, 16)])
    def test_a_change_under_a_key_is_one_durable_commit(
        self, app, api, counted, route: Any, most: int
    ) -> None:
        method, path, body, headers = route(api)
        api.get(f"{API}/groups/2")
        with counted(app.state.services.store) as cost:
            api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        # The group is read; the answer is written with the change. What is told by one statement,
        # the key and whose annotation it is, needs no transaction.
        assert (cost.reads, cost.writes, cost.commits) == (1, 1, 1)
        assert cost.statements <= most
