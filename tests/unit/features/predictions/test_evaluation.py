from __future__ import annotations

import json

import pytest
from sqlalchemy import func, select

from app.errors import ConflictError, InputError, NotFoundError
from app.features.datasets.service import delete_dataset
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.predictions.accept import AcceptRequest, accept_predicted_balls
from app.features.predictions.evaluation import (
    FrameQuery,
    compare_runs,
    get_chart,
    get_evaluation,
    list_evaluations,
    list_frames,
    parse_run_tables,
    remove_evaluation,
)
from app.features.predictions.evaluation_run import (
    EvaluationRequest,
    require_valid_evaluation_request,
    run_evaluation,
)
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions
from app.features.predictions.tables import (
    EvaluationFrameModel,
    EvaluationModel,
    PredictionModel,
    PredictionSetModel,
)
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from tests.unit.stores import MATCH


def predict(store, path, states, factor: float, name: str):
    """The optimised box of every view, its size times a factor."""
    values = []
    for state in states:
        for view in state.solution.views:
            box = view.ball.optimized_box
            d, (x, y) = box.width * factor, box.center
            # COCO counts from the corner of the first pixel.
            bbox = [x + 0.5 - d / 2, y + 0.5 - d / 2, d, d]
            frame = f"{MATCH}/{view.view}"
            values.append({"image_id": frame, "category_id": 1, "bbox": bbox, "score": 0.9})
    path.write_text(json.dumps(values))
    return add_predictions(store, "demo", name, PredictionFiles(path), actor="ann")


@pytest.fixture
def states(store, fill, make_group):
    """Three groups that pass: two of the training split, one of the test split."""
    ids = fill(make_group(7), make_group(8), make_group(9, split="test"))
    return [load_group_state(store, identity) for identity in ids]


@pytest.fixture
def exact(store, states, tmp_path):
    return predict(store, tmp_path / "a.json", states, 1.0, "exact")


@pytest.fixture
def loose(store, states, tmp_path):
    return predict(store, tmp_path / "b.json", states, 1.25, "loose")


def cell(found, table: str, row: str, column: str):
    return next(item for item in parse_run_tables(found) if item.name == table).cell(row, column)


class TestRunEvaluation:
    def test_measures_against_the_dataset_as_it_is(self, store, exact) -> None:
        found = run_evaluation(store, "demo", EvaluationRequest(predictions=exact.id), actor="ann")
        assert cell(found, "detection", "all", "ap_50").value == 1
        assert cell(found, "localization", "oracle", "mae_m").value < 0.05
        assert (found.name, found.counts["balls"], found.counts["groups"]) == ("exact", 6, 3)

    def test_pins_the_state_policy_and_predictions_that_it_used(self, store, states, exact) -> None:
        request = EvaluationRequest(predictions=exact.id)
        first = run_evaluation(store, "demo", request, actor="ann")
        again = run_evaluation(store, "demo", request, actor="bob")
        assert again.pins == first.pins
        assert again.tables == first.tables
        assert first.pins["predictions"]["digest"] == exact.digest
        assert first.pins["predictions"]["source"] == "a.json"
        assert first.pins["predictions"]["unknown"] == 0
        assert first.pins["policy_hash"] == states[0].policy.hash
        edit = make_set_ball_edit("7.png", None)
        submit_edit(store, states[0].id, edit, if_match=states[0].etag, actor="ann")
        assert (
            run_evaluation(store, "demo", request, actor="ann").pins["state"] != first.pins["state"]
        )

    def test_a_frozen_version_does_not_change_under_it(self, store, states, exact) -> None:
        version = freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")
        request = EvaluationRequest(predictions=exact.id, version=version.id)
        first = run_evaluation(store, "demo", request, actor="ann")
        edit = make_set_ball_edit("7.png", None)
        submit_edit(store, states[0].id, edit, if_match=states[0].etag, actor="ann")
        again = run_evaluation(store, "demo", request, actor="ann")
        assert (again.pins, again.tables) == (first.pins, first.tables)
        assert first.pins["version_hash"] == version.hash
        live = run_evaluation(store, "demo", EvaluationRequest(predictions=exact.id), actor="ann")
        assert live.counts["groups"] == 2

    def test_a_version_and_the_same_live_state_give_the_same_numbers(self, store, exact) -> None:
        version = freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")
        frozen, live = (
            run_evaluation(
                store, "demo", EvaluationRequest(predictions=exact.id, version=number), actor="a"
            )
            for number in (version.id, None)
        )
        assert frozen.tables == live.tables
        assert frozen.counts == live.counts

    def test_a_split_and_a_verdict_choose_frames(self, store, states, exact) -> None:
        test = EvaluationRequest(predictions=exact.id, split="test")
        assert run_evaluation(store, "demo", test, actor="a").counts["frames"] == 2
        set_verdict(
            store, states[0].id, "rejected", "duplicate_view", if_match=states[0].etag, actor="a"
        )
        every = EvaluationRequest(predictions=exact.id)
        assert run_evaluation(store, "demo", every, actor="a").counts["frames"] == 4
        whole = EvaluationRequest(predictions=exact.id, groups="all")
        assert run_evaluation(store, "demo", whole, actor="a").counts["frames"] == 6

    def test_careful_boxes_make_the_papers_first_table(self, store, exact) -> None:
        found = run_evaluation(store, "demo", EvaluationRequest(careful=exact.id), actor="ann")
        assert [table["name"] for table in found.tables] == ["boxes", "sensitivity"]
        assert cell(found, "boxes", "optimized", "iou").value == pytest.approx(1)
        assert cell(found, "boxes", "annotated", "iou").value < 1

    def test_two_careful_boxes_in_a_frame_are_refused_with_its_name(
        self, store, states, exact, tmp_path
    ) -> None:
        path = tmp_path / "a.json"
        values = json.loads(path.read_text())
        path.write_text(json.dumps([*values, values[1]]))
        twice = add_predictions(store, "demo", "twice", PredictionFiles(path), actor="ann")
        request = EvaluationRequest(predictions=exact.id, careful=twice.id)
        for refused in (
            require_valid_evaluation_request,
            lambda *args: run_evaluation(*args, actor="ann"),
        ):
            with pytest.raises(InputError, match="have more than one box") as caught:
                refused(store, "demo", request)
            assert caught.value.pointer == "/careful"
            assert caught.value.message.endswith(f": {values[1]['image_id']}")
        assert list_evaluations(store, "demo") == []

    def test_predictions_of_other_frames_than_take_part_are_no_evaluation(
        self, store, states, tmp_path
    ) -> None:
        train = predict(store, tmp_path / "t.json", states[:2], 1.0, "train")
        request = EvaluationRequest(predictions=train.id, split="test")
        with pytest.raises(
            InputError, match='none of the 4 frames of "train" is among the 2 frames'
        ):
            run_evaluation(store, "demo", request, actor="ann")
        assert list_evaluations(store, "demo") == []

    def test_a_truth_that_was_a_prediction_is_counted_and_warned_of(
        self, store, states, exact, loose
    ) -> None:
        clean = run_evaluation(store, "demo", EvaluationRequest(predictions=exact.id), actor="ann")
        assert clean.counts["accepted_predictions"] == 0
        assert not any("Warning" in table.note for table in parse_run_tables(clean))
        view = states[0].view_ids["7.png"]
        accept_predicted_balls(
            store, "demo", AcceptRequest(exact.id, views=(view,), replace=True), actor="ann"
        )
        own, other = (
            run_evaluation(store, "demo", EvaluationRequest(predictions=item.id), actor="ann")
            for item in (exact, loose)
        )
        assert own.counts["accepted_predictions"] == other.counts["accepted_predictions"] == 1
        notes = [
            next(item.note for item in parse_run_tables(run) if item.name == "detection")
            for run in (own, other)
        ]
        assert all("Warning: the ball of 1 of 6 frames is an accepted" in note for note in notes)
        assert ["the evaluated set itself" in note for note in notes] == [True, False]

    @pytest.mark.parametrize(
        ("change", "error"),
        [
            ({"predictions": None}, InputError),
            ({"predictions": 99}, NotFoundError),
            ({"version": 99}, NotFoundError),
            ({"boxes": "round"}, InputError),
            ({"min_score": 2.0}, InputError),
            ({"groups": "none"}, InputError),
            ({"groups": "accepted"}, InputError),
            ({"split": "valid"}, InputError),
        ],
    )
    def test_an_impossible_request_is_refused(self, store, exact, change, error) -> None:
        values = {"predictions": exact.id, **change}
        with pytest.raises(error):
            run_evaluation(store, "demo", EvaluationRequest(**values), actor="ann")
        assert list_evaluations(store, "demo") == []

    def test_groups_that_nobody_has_solved_are_no_truth(
        self, store, fill, make_group, exact
    ) -> None:
        fill(make_group(10), solved=False)
        with pytest.raises(ConflictError, match="1 group that may take part is not solved yet"):
            run_evaluation(store, "demo", EvaluationRequest(predictions=exact.id), actor="ann")


class TestListFrames:
    @pytest.fixture
    def run(self, store, loose):
        return run_evaluation(store, "demo", EvaluationRequest(predictions=loose.id), actor="ann")

    def test_a_row_opens_the_frames_that_it_counts(self, store, run) -> None:
        table = next(item for item in parse_run_tables(run) if item.name == "detection_by_distance")
        for row in table.rows:
            query = FrameQuery(row.frames.field, row.frames.low, row.frames.high)
            page = list_frames(store, run.id, query)
            assert page.total == row.cells[0].count
            assert all(frame.group_id for frame in page.items)

    def test_pages_follow_each_other_in_order(self, store, run) -> None:
        whole = list_frames(store, run.id, FrameQuery(sort="error_m-desc"))
        errors = [frame.error_m for frame in whole.items]
        assert errors == sorted(errors, reverse=True)
        pieces, place = [], 0
        while place is not None:
            page = list_frames(store, run.id, FrameQuery(sort="error_m-desc"), 4, place)
            pieces += page.items
            place = page.next
        assert pieces == whole.items

    def test_missing_values_can_be_asked_for(self, store, run) -> None:
        assert list_frames(store, run.id, FrameQuery("error_m", missing=True)).total == 0
        assert list_frames(store, run.id, FrameQuery("predicted_error_m", missing=True)).total == 6

    def test_an_unknown_field_is_refused(self, store, run) -> None:
        for query in (FrameQuery("group"), FrameQuery(sort="; drop table")):
            with pytest.raises(InputError, match="no field"):
                list_frames(store, run.id, query)


class TestFigures:
    def test_tables_and_figures_come_back_as_they_were(self, store, exact) -> None:
        run = run_evaluation(store, "demo", EvaluationRequest(predictions=exact.id), actor="ann")
        figure = get_chart(store, run.id, "precision_recall")
        assert figure.panels[0].series[0].y[-1] == 1
        assert figure.panels[0].x.high == 1
        with pytest.raises(NotFoundError, match='no figure "jac"'):
            get_chart(store, run.id, "jac")


class TestCompare:
    def test_tells_numbers_and_frames_that_changed(self, store, exact, loose) -> None:
        runs = [
            run_evaluation(store, "demo", EvaluationRequest(predictions=item.id), actor="ann")
            for item in (loose, exact)
        ]
        found = compare_runs(store, runs[0].id, runs[1].id)
        assert (found.same_truth, found.differs) == (True, ())
        assert (found.frames.better, found.frames.worse, found.frames.shared) == (6, 0, 6)
        change = next(item for item in found.numbers if item.column == "mae_m")
        assert change.change is not None and change.change < -5

    def test_says_when_the_truth_is_another(self, store, exact) -> None:
        runs = [
            run_evaluation(
                store, "demo", EvaluationRequest(predictions=exact.id, split=split), actor="ann"
            )
            for split in (None, "test")
        ]
        found = compare_runs(store, runs[0].id, runs[1].id)
        assert (found.same_truth, found.differs) == (False, ("split",))
        with pytest.raises(InputError, match="compared by"):
            compare_runs(store, runs[0].id, runs[1].id, "group")

    def test_other_careful_boxes_are_another_truth(self, store, exact, loose) -> None:
        runs = [
            run_evaluation(
                store, "demo", EvaluationRequest(predictions=exact.id, careful=careful), actor="a"
            )
            for careful in (exact.id, loose.id, None)
        ]
        other = compare_runs(store, runs[0].id, runs[1].id)
        assert (other.same_truth, other.differs) == (False, ("careful",))
        assert compare_runs(store, runs[0].id, runs[2].id).same_truth

    def test_says_when_the_software_is_another(self, store, exact, monkeypatch) -> None:
        request = EvaluationRequest(predictions=exact.id)
        first = run_evaluation(store, "demo", request, actor="ann")
        monkeypatch.setattr("app.features.predictions.frames.read_software_version", lambda: "99.0")
        second = run_evaluation(store, "demo", request, actor="ann")
        found = compare_runs(store, first.id, second.id)
        assert (found.same_truth, found.differs) == (True, ("software_version",))


class TestRemoveEvaluation:
    def test_takes_its_frames_along(self, store, exact) -> None:
        run = run_evaluation(store, "demo", EvaluationRequest(predictions=exact.id), actor="ann")
        remove_evaluation(store, run.id, actor="local")
        with pytest.raises(NotFoundError):
            get_evaluation(store, run.id)
        with store.read() as session:
            rows = select(func.count()).select_from(EvaluationFrameModel)
            assert session.execute(rows).scalar() == 0


class TestDeletedDataset:
    def test_takes_predictions_and_evaluations_along(self, store, exact) -> None:
        run_evaluation(store, "demo", EvaluationRequest(predictions=exact.id), actor="ann")
        delete_dataset(store, "demo", confirm="demo", actor="ann")
        with store.read() as session:
            for model in (
                PredictionSetModel,
                PredictionModel,
                EvaluationModel,
                EvaluationFrameModel,
            ):
                assert session.execute(select(func.count()).select_from(model)).scalar() == 0
