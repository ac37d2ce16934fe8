"""Predicted tracks against those of a version: from files to an evaluation that is kept."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from app.db.store import Store
from app.errors import InputError
from app.features.exports.service import export_dataset
from app.features.predictions.evaluation import get_chart, parse_run_tables
from app.features.predictions.evaluation_run import (
    EvaluationRequest,
    SourcesEvaluationRequest,
    evaluate_sources,
    require_valid_evaluation_request,
)
from app.features.predictions.queries import PredictionSet
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions, get_predictions
from app.features.tracks.service import TrackReview, get_track, review_track
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from tests.flights import add_flight


@pytest.fixture
def accepted(store: Store) -> Store:
    """A flight whose track is accepted and frozen as v1."""
    track = get_track(store, add_flight(store))
    review_track(store, track.id, TrackReview("accepted"), track.etag, actor="ann")
    freeze_dataset(store, "flight", FreezeRequest("v1", groups="passing"), actor="ann")
    return store


@pytest.fixture
def own(accepted: Store, tmp_path: Path) -> Path:
    """The product's own tracks, as a folder of files."""
    export_dataset(accepted, "flight", "tracks", tmp_path / "out", version="v1")
    return tmp_path / "out"


def evaluated(store: Store, path: Path, version: str | None = "v1", **asked: object):
    request = SourcesEvaluationRequest(
        EvaluationRequest(**asked),  # type: ignore[arg-type]
        PredictionFiles(path),
        PredictionFiles(None),
        version,
    )
    return evaluate_sources(store, "flight", request, actor="ann").evaluation


def shifted(own: Path, by: float) -> Path:
    """Its balls, farther along the pitch."""
    with (own / "ball.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    path = own.parent / "other.csv"
    lines = ["frame,x_m,y_m,z_m,sigma_m"]
    lines += [
        f"{row['frame']},{float(row['x_m']) + by},{row['y_m']},{row['z_m']},0.2"
        for row in rows
        if row["x_m"]
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


class TestEvaluation:
    def test_our_own_track_is_without_an_error(self, accepted, own) -> None:
        found = evaluated(accepted, own)
        tables = {table.name: table for table in parse_run_tables(found)}
        assert tables["tracks"].cell("all", "mae_m").value == pytest.approx(0.0, abs=1e-12)
        assert tables["tracks"].cell("all", "coverage").value == 1.0
        assert tables["track_events"].cell("any", "f1").value == 1.0
        assert get_chart(accepted, found.id, "track_distance").panels[0].series[0].y[1] == 1.0
        assert found.counts["track_frames"] == found.counts["track_frames_compared"] > 30

    def test_another_one_has_its_error_and_what_pins_the_truth(self, accepted, own) -> None:
        found = evaluated(accepted, shifted(own, 0.5), name="mine")
        (table,) = parse_run_tables(found)
        assert table.cell("all", "mae_m").value == pytest.approx(0.5)
        assert table.cell("all", "inside_95").value == 1.0
        assert (found.name, found.pins["version_name"]) == ("mine", "v1")
        assert found.pins["predictions"]["name"] == "other"

    def test_without_a_version_the_accepted_tracks_are_the_truth(self, accepted, own) -> None:
        found = evaluated(accepted, shifted(own, 0.5), None)
        assert (found.version_id, found.pins["groups"]) == (None, "accepted")
        assert parse_run_tables(found)[0].cell("all", "mae_m").value == pytest.approx(0.5)

    def test_a_dataset_without_accepted_tracks_says_so(self, store, tmp_path: Path) -> None:
        add_flight(store)
        path = tmp_path / "ball.csv"
        path.write_text("frame,x_m,y_m,z_m\n101,0,0,-1\n")
        with pytest.raises(InputError, match='"flight" has no accepted ball track'):
            evaluated(store, path, None)

    @pytest.mark.parametrize("asked", [{"split": "test"}, {"boxes": "exact"}, {"min_score": 0.5}])
    def test_what_tracks_do_not_use_is_refused_at_once(self, accepted, own, asked) -> None:
        found = add_predictions(accepted, "flight", None, PredictionFiles(own), actor="ann")
        request = EvaluationRequest(predictions=found.id, **asked)
        with pytest.raises(InputError, match=f"{next(iter(asked))} is not used"):
            require_valid_evaluation_request(accepted, "flight", request)


class TestSets:
    def test_a_set_counts_its_tracks_and_is_found_again(self, accepted, own) -> None:
        sets: list[PredictionSet] = [
            add_predictions(accepted, "flight", None, PredictionFiles(own), actor="ann")
            for _ in range(2)
        ]
        assert sets[0] == sets[1] == get_predictions(accepted, sets[0].id)
        assert (sets[0].format, sets[0].tracks, sets[0].boxes) == ("tracks", 1, 0)
        other = add_predictions(
            accepted, "flight", None, PredictionFiles(shifted(own, 1.0)), actor="ann"
        )
        assert other.digest != sets[0].digest

    def test_a_file_without_a_ball_is_refused(self, accepted, tmp_path: Path) -> None:
        path = tmp_path / "ball.csv"
        path.write_text("frame,x_m,y_m,z_m\n101,,,\n")
        with pytest.raises(InputError, match=r"ball\.csv contains no ball"):
            add_predictions(accepted, "flight", None, PredictionFiles(path), actor="ann")

    def test_cameras_do_not_come_with_tracks(self, accepted, own) -> None:
        with pytest.raises(InputError, match="cannot be imported together with cameras"):
            add_predictions(
                accepted, "flight", None, PredictionFiles(own, cameras=own), actor="ann"
            )
