from __future__ import annotations

import json

import pytest

from app.errors import NotFoundError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit, submit_edits
from app.features.groups.undo import redo_group_edit, undo_group_edit
from app.features.predictions.accept import AcceptedBall, accept_box, read_group_predictions
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions, delete_predictions
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box


@pytest.fixture
def ids(store, fill, make_group):
    """Two groups."""
    return fill(make_group(7), make_group(8))


@pytest.fixture
def add(store, ids, tmp_path):
    """A function that adds a set: ``add("name", ("7.png", 10, 0.6), ...)``."""

    def one(name, *boxes):
        values = [
            {"image_id": image, "category_id": 1, "bbox": [x + 0.5, 300.5, 14, 14], "score": score}
            for image, x, score in boxes
        ]
        path = tmp_path / f"{name}.json"
        path.write_text(json.dumps(values))
        return add_predictions(store, "demo", name, PredictionFiles(path), actor="ann")

    return one


def accept_first(store, group_id: int, actor: str):
    """Accept what is predicted first for a group, over any ball."""
    state, (_, box) = (
        load_group_state(store, group_id),
        read_group_predictions(store, group_id).boxes[0],
    )
    return accept_box(store, box.view_id, box.id, if_match=state.etag, actor=actor, replace=True)


class TestGroupPredictions:
    def test_are_those_of_its_views_the_newest_set_and_the_surest_box_first(
        self, store, ids, add
    ) -> None:
        add("old", ("7_1.png", 1, 0.9), ("7.png", 2, 0.9))
        add("new", ("7.png", 3, 0.2), ("7.png", 4, 0.8), ("8.png", 5, 0.9))
        found = read_group_predictions(store, ids[0])
        views = {view: key for key, view in load_group_state(store, ids[0]).view_ids.items()}
        assert [(views[box.view_id], item.name, box.x) for item, box in found.boxes] == [
            ("7.png", "new", 4),
            ("7.png", "new", 3),
            ("7.png", "old", 2),
            ("7_1.png", "old", 1),
        ]
        assert found.accepted == ()

    def test_says_how_many_prediction_sets_the_dataset_has(self, store, ids, add) -> None:
        assert read_group_predictions(store, ids[0]).sets == 0
        add("one", ("8.png", 5, 0.9))
        found = read_group_predictions(store, ids[0])
        assert (found.sets, found.boxes) == (1, ())

    def test_an_unknown_group_is_not_found(self, store, ids) -> None:
        with pytest.raises(NotFoundError):
            read_group_predictions(store, 999)


class TestAcceptedBall:
    def test_says_the_set_the_score_and_who_accepted_it(self, store, ids, add) -> None:
        add("yolo", ("7.png", 10, 0.75))
        accept_first(store, ids[0], "bob")
        (ball,) = read_group_predictions(store, ids[0]).accepted
        assert (ball.view, ball.name, ball.score, ball.actor) == ("7.png", "yolo", 0.75, "bob")
        assert ball.at is not None

    def test_stays_with_who_accepted_it_when_others_undo_and_redo(self, store, ids, add) -> None:
        add("yolo", ("7.png", 10, 0.75))
        state = accept_first(store, ids[0], "bob")
        state = undo_group_edit(store, ids[0], if_match=state.etag, actor="eve")
        assert read_group_predictions(store, ids[0]).accepted == ()
        redo_group_edit(store, ids[0], if_match=state.etag, actor="eve")
        (ball,) = read_group_predictions(store, ids[0]).accepted
        assert ball.actor == "bob"

    def test_is_theirs_who_accepted_it_among_other_changes_too(self, store, ids, add) -> None:
        add("yolo", ("7.png", 10, 0.75))
        state = accept_first(store, ids[0], "bob")
        ball = state.group.views[0].ball
        state = undo_group_edit(store, ids[0], if_match=state.etag, actor="bob")
        edits = [
            make_set_ball_edit("7.png", ball),
            make_set_ball_edit(state.group.views[1].key, None),
        ]
        submit_edits(store, ids[0], edits, if_match=state.etag, actor="eve")
        (found,) = read_group_predictions(store, ids[0]).accepted
        assert found.actor == "eve"

    def test_outlives_its_set_but_not_the_score(self, store, ids, add) -> None:
        found = add("yolo", ("7.png", 10, 0.75))
        accept_first(store, ids[0], "bob")
        delete_predictions(store, found.id, actor="local")
        (ball,) = read_group_predictions(store, ids[0]).accepted
        assert (ball.name, ball.score, ball.actor) == ("yolo", None, "bob")

    def test_a_ball_that_a_person_moved_is_none(self, store, ids, add) -> None:
        add("yolo", ("7.png", 10, 0.75))
        state = accept_first(store, ids[0], "bob")
        moved = make_set_ball_edit("7.png", BallAnnotation(box=Box(11, 300, 14, 14)))
        submit_edit(store, ids[0], moved, if_match=state.etag, actor="bob")
        assert read_group_predictions(store, ids[0]).accepted == ()

    def test_an_imported_prediction_names_nobody(self, store, fill, make_group) -> None:
        group = make_group(7)
        ball = BallAnnotation(box=Box(10, 300, 14, 14), predicted_by="elsewhere")
        (group_id,) = fill(make_set_ball_edit("7.png", ball).apply(group))
        assert read_group_predictions(store, group_id).accepted == (
            AcceptedBall(
                load_group_state(store, group_id).view_ids["7.png"],
                "7.png",
                "elsewhere",
                None,
                None,
                None,
            ),
        )
