from __future__ import annotations

import json

import pytest

from app.db.session import now
from app.errors import NotFoundError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.jobs.queries import NewJob, insert_job
from app.features.jobs.service import Jobs
from app.features.predictions.accept import AcceptRequest
from app.features.predictions.evaluation import list_evaluations
from app.features.predictions.evaluation_run import EvaluationRequest
from app.features.predictions.jobs import (
    register_prediction_jobs,
    request_accept,
    request_evaluation,
)
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions


@pytest.fixture
def jobs(store):
    jobs = Jobs(store)
    register_prediction_jobs(jobs, store)
    yield jobs
    jobs.close()


@pytest.fixture
def predictions(store, state, tmp_path):
    box = state.solution.views[0].ball.optimized_box
    bbox = [box.x + 0.5, box.y + 0.5, box.width, box.height]
    value = {"image_id": "7.png", "category_id": 1, "bbox": bbox, "score": 0.9}
    (tmp_path / "p.json").write_text(json.dumps([value]))
    files = PredictionFiles(tmp_path / "p.json")
    return add_predictions(store, "demo", "yolo", files, actor="ann")


class TestRequestEvaluation:
    def test_its_result_names_the_evaluation(self, store, jobs, predictions) -> None:
        jobs.start()
        request = EvaluationRequest(predictions=predictions.id, name="one")
        job = jobs.wait(request_evaluation(jobs, store, "demo", request, actor="ann").id, 60)
        assert job.state == "done", job.problem
        (found,) = list_evaluations(store, "demo")
        assert job.result == {"evaluation": found.id, "name": "one", "counts": found.counts}
        assert (job.done, job.total) == (4, 4)

    def test_an_unknown_set_is_refused_before_a_job_starts(self, store, jobs, predictions) -> None:
        with pytest.raises(NotFoundError):
            request_evaluation(jobs, store, "demo", EvaluationRequest(predictions=99), actor="ann")
        assert jobs.find() == []


class TestResume:
    def left(self, store, state, predictions) -> None:
        """A job that an earlier server did not end."""
        request = {"predictions": predictions.id, "name": "left"}
        with store.write() as session:
            insert_job(session, NewJob("evaluate", "t", "ann", state.dataset_id, request))

    def test_an_evaluation_that_a_server_left_is_done_by_the_next(
        self, store, state, jobs, predictions
    ) -> None:
        self.left(store, state, predictions)
        jobs.start()
        assert jobs.wait(1, 60).state == "done"
        assert [item.name for item in list_evaluations(store, "demo")] == ["left"]

    def test_one_that_was_done_but_for_its_record_is_not_done_twice(
        self, store, state, jobs, predictions
    ) -> None:
        self.left(store, state, predictions)
        before = now()
        other = Jobs(store)
        request = EvaluationRequest(predictions=predictions.id, name="left")
        done = request_evaluation(other, store, "demo", request, actor="ann")
        assert other.wait(done.id, 60).state == "done"
        other.close()
        jobs.start()
        job = jobs.wait(1, 60)
        (found,) = list_evaluations(store, "demo")
        assert found.created >= before
        assert job.result["evaluation"] == found.id


class TestRequestAccept:
    def test_counts_what_changed(self, store, state, jobs, predictions) -> None:
        jobs.start()
        submit_edit(
            store, state.id, make_set_ball_edit("7.png", None), if_match=state.etag, actor="ann"
        )
        request = AcceptRequest(predictions.id, query="")
        job = jobs.wait(request_accept(jobs, store, "demo", request, actor="bob").id, 60)
        assert job.state == "done", job.problem
        assert job.result == {"changed": 1, "groups": 1, "refused": {}}
        assert load_group_state(store, state.id).group.view("7.png").ball.predicted_by == "yolo"
