from __future__ import annotations

import json

import pytest

from app.errors import ConflictError, InputError, NotFoundError, StaleRevisionError
from app.evaluation.frame import Detection
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.predictions.accept import (
    AcceptRequest,
    accept_box,
    accept_predicted_balls,
    plan_accept,
    read_group_predictions,
)
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions, read_frame_names, save_predictions
from app.soccer.frames import Box


@pytest.fixture
def cleared(store, fill, make_group):
    """Two groups; nobody annotated a ball in the main view of the first."""
    ids = fill(make_group(7), make_group(8))
    state = load_group_state(store, ids[0])
    return submit_edit(
        store, ids[0], make_set_ball_edit("7.png", None), if_match=state.etag, actor="ann"
    )


@pytest.fixture
def predictions(store, cleared, tmp_path):
    """Two boxes in 7.png, one in 7_1.png, a less sure one in 8.png."""
    boxes = [("7.png", 10, 0.6), ("7.png", 600, 0.9), ("7_1.png", 20, 0.8), ("8.png", 30, 0.4)]
    values = [
        {"image_id": name, "category_id": 1, "bbox": [x + 0.5, 300.5, 14, 14], "score": score}
        for name, x, score in boxes
    ]
    path = tmp_path / "p.json"
    path.write_text(json.dumps(values))
    return add_predictions(store, "demo", "yolo", PredictionFiles(path), actor="ann")


@pytest.fixture
def absurd(store, cleared):
    """A set as no reader lets it in any more: a box as wide as a country."""
    found = {cleared.view_ids["7.png"]: [Detection(Box(1, 2, 3e9, 4), 0.95)]}
    names = read_frame_names(store, "demo")
    report = {"problems": [], "more_problems": 0}
    return save_predictions(
        store, "demo", "old", found, {},
        names=names, format="coco", source="old.json", report=report, actor="ann",
    )  # fmt: skip


class TestPlanAccept:
    def test_a_box_that_can_be_no_ball_is_refused_as_such(self, store, absurd) -> None:
        plan = plan_accept(store, "demo", AcceptRequest(absurd.id))
        assert (plan.changes, plan.refused) == ((), {"not_a_ball": 1})
        assert accept_predicted_balls(
            store, "demo", AcceptRequest(absurd.id), actor="bob"
        ).refused == {"not_a_ball": 1}

    def test_takes_the_surest_of_views_without_a_ball(self, store, cleared, predictions) -> None:
        plan = plan_accept(store, "demo", AcceptRequest(predictions.id))
        assert [(item.view, item.box.x) for item in plan.changes] == [("7.png", 600)]
        assert plan.refused == {"annotated": 2}
        assert load_group_state(store, cleared.id) == cleared

    def test_replaces_where_it_is_told_to(self, store, predictions) -> None:
        plan = plan_accept(
            store, "demo", AcceptRequest(predictions.id, replace=True, min_score=0.5)
        )
        assert [item.view for item in plan.changes] == ["7.png", "7_1.png"]
        assert plan.refused == {"below_score": 1}

    def test_a_query_chooses_groups(self, store, predictions) -> None:
        request = AcceptRequest(predictions.id, query="number:2", replace=True)
        assert [item.view for item in plan_accept(store, "demo", request).changes] == ["8.png"]

    def test_an_unknown_set_view_or_prediction_is_refused(
        self, store, cleared, predictions
    ) -> None:
        with pytest.raises(NotFoundError):
            plan_accept(store, "demo", AcceptRequest(99))
        with pytest.raises(NotFoundError, match="no prediction for view"):
            plan_accept(store, "demo", AcceptRequest(predictions.id, views=(12345,)))
        with pytest.raises(InputError):
            plan_accept(store, "demo", AcceptRequest(predictions.id, query="nothing:at_all"))


class TestAccept:
    def test_makes_an_edit_whose_ball_says_where_it_is_from(
        self, store, cleared, predictions
    ) -> None:
        report = accept_predicted_balls(store, "demo", AcceptRequest(predictions.id), actor="bob")
        assert (report.views, report.groups, report.refused) == (1, 1, {"annotated": 2})
        after = load_group_state(store, cleared.id)
        ball = after.group.view("7.png").ball
        assert ball.box == Box(600, 300, 14, 14)
        assert ball.predicted_by == "yolo"
        entry = read_history(store, cleared.id)[-1]
        assert (entry.kind, entry.actor) == ("edit", "bob")
        assert entry.body["edit"]["balls"][0]["predicted_by"] == "yolo"
        # Only now a solve has seen it.
        assert cleared.solution.ball is None
        assert after.solution is not None

    def test_can_be_undone(self, store, cleared, predictions) -> None:
        accept_predicted_balls(store, "demo", AcceptRequest(predictions.id), actor="bob")
        after = load_group_state(store, cleared.id)
        assert (
            undo_group_edit(store, cleared.id, if_match=after.etag, actor="bob").group
            == cleared.group
        )

    def test_done_again_it_changes_nothing(self, store, cleared, predictions) -> None:
        request = AcceptRequest(predictions.id, replace=True)
        accept_predicted_balls(store, "demo", request, actor="bob")
        before = load_group_state(store, cleared.id)
        report = accept_predicted_balls(store, "demo", request, actor="bob")
        assert (report.views, report.refused) == (0, {"the_same": 3})
        assert load_group_state(store, cleared.id) == before

    def test_changes_only_the_views_that_are_named(self, store, cleared, predictions) -> None:
        view = cleared.view_ids["7_1.png"]
        request = AcceptRequest(predictions.id, views=(view,), replace=True)
        assert accept_predicted_balls(store, "demo", request, actor="bob").views == 1
        assert load_group_state(store, cleared.id).group.view("7.png").balls == ()

    def test_a_person_who_moves_it_is_the_source_from_then_on(
        self, store, cleared, predictions
    ) -> None:
        from app.soccer.annotation import BallAnnotation

        accept_predicted_balls(store, "demo", AcceptRequest(predictions.id), actor="bob")
        state = load_group_state(store, cleared.id)
        edit = make_set_ball_edit("7.png", BallAnnotation(box=Box(601, 300, 14, 14)))
        after = submit_edit(store, cleared.id, edit, if_match=state.etag, actor="bob")
        assert after.group.view("7.png").ball.predicted_by == ""

    def test_the_log_alone_rebuilds_it(self, store, cleared, predictions) -> None:
        accept_predicted_balls(store, "demo", AcceptRequest(predictions.id), actor="bob")
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_a_group_that_changed_meanwhile_is_left_alone(
        self, store, cleared, predictions, monkeypatch
    ) -> None:
        plan = plan_accept(store, "demo", AcceptRequest(predictions.id))
        accept_predicted_balls(store, "demo", AcceptRequest(predictions.id), actor="bob")
        monkeypatch.setattr("app.features.predictions.accept.plan_accept", lambda *_: plan)
        report = accept_predicted_balls(store, "demo", AcceptRequest(predictions.id), actor="eve")
        assert report.refused["changed_meanwhile"] == 1
        assert read_history(store, cleared.id)[-1].actor == "bob"

    def test_progress_can_end_it_and_what_was_accepted_stays(
        self, store, cleared, predictions
    ) -> None:
        def stop(done, _total, _sentence) -> None:
            if done == 1:
                raise KeyboardInterrupt

        request = AcceptRequest(predictions.id, replace=True)
        with pytest.raises(KeyboardInterrupt):
            accept_predicted_balls(store, "demo", request, actor="bob", progress=stop)
        assert load_group_state(store, cleared.id).group.view("7_1.png").ball.predicted_by == "yolo"
        assert accept_predicted_balls(store, "demo", request, actor="bob").views == 1


class TestAcceptBox:
    def test_a_box_that_can_be_no_ball_is_refused_with_the_reason(
        self, store, cleared, absurd
    ) -> None:
        view, box = cleared.view_ids["7.png"], self.box(store, cleared, 0.95)
        with pytest.raises(InputError, match="wider or higher than the image"):
            accept_box(store, view, box, if_match=cleared.etag, actor="bob")
        with pytest.raises(StaleRevisionError):
            accept_box(store, view, box, if_match='"0"', actor="bob")
        assert load_group_state(store, cleared.id) == cleared

    def box(self, store, cleared, score: float) -> int:
        found = read_group_predictions(store, cleared.id).boxes
        return next(box.id for _, box in found if box.score == score)

    def test_takes_the_one_that_is_named_and_not_the_surest(
        self, store, cleared, predictions
    ) -> None:
        view, less_sure = cleared.view_ids["7.png"], self.box(store, cleared, 0.6)
        after = accept_box(store, view, less_sure, if_match=cleared.etag, actor="bob")
        assert after.group.view("7.png").ball.box == Box(10, 300, 14, 14)
        assert after.group.view("7.png").ball.predicted_by == "yolo"
        back = undo_group_edit(store, cleared.id, if_match=after.etag, actor="bob")
        assert back.group == cleared.group

    def test_a_view_with_a_ball_keeps_it_unless_it_is_to_be_replaced(
        self, store, cleared, predictions
    ) -> None:
        view, box = cleared.view_ids["7_1.png"], self.box(store, cleared, 0.8)
        with pytest.raises(ConflictError, match="has a ball already") as refused:
            accept_box(store, view, box, if_match=cleared.etag, actor="bob")
        assert "replace" in refused.value.hint
        assert load_group_state(store, cleared.id) == cleared
        after = accept_box(store, view, box, if_match=cleared.etag, actor="bob", replace=True)
        assert after.group.view("7_1.png").ball.box == Box(20, 300, 14, 14)

    def test_an_accept_on_an_older_state_is_refused(self, store, cleared, predictions) -> None:
        view, box = cleared.view_ids["7.png"], self.box(store, cleared, 0.9)
        accept_box(store, view, box, if_match=cleared.etag, actor="bob")
        with pytest.raises(StaleRevisionError):
            accept_box(
                store, view, self.box(store, cleared, 0.6), if_match=cleared.etag, actor="eve"
            )

    def test_an_older_state_is_reported_before_a_missing_prediction(
        self, store, cleared, predictions
    ) -> None:
        view = cleared.view_ids["7.png"]
        with pytest.raises(StaleRevisionError):
            accept_box(store, view, 9999, if_match='"older"', actor="eve")

    def test_a_prediction_of_another_view_is_not_found(self, store, cleared, predictions) -> None:
        other, box = cleared.view_ids["7_1.png"], self.box(store, cleared, 0.9)
        for view, asked in ((other, box), (other, 9999)):
            with pytest.raises(NotFoundError, match="has no prediction"):
                accept_box(store, view, asked, if_match=cleared.etag, actor="bob")
