"""Predicted tracks, read as people and the product's own export write them."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.errors import DatasetFormatError, InputError
from app.evaluation.frame import FrameNameIndex
from app.evaluation.prediction_files import read_predictions
from app.evaluation.prediction_run import LoadedPredictions, PredictedTrack
from app.soccer.frames import ImageSize

HEAD = "frame,time_s,x_m,y_m,z_m,sigma_m,state,cameras\n"
ROWS = "100,4.0,1.0,2.0,-0.5,0.1,measured,cam1 cam2\n101,4.04,,,,,gap,\n102,4.08,1.5,2,-0.6,,one_view,cam1\n"


def read(path: Path, format: str = "auto", **options: object) -> LoadedPredictions:  # noqa: A002
    return read_predictions(path, format, FrameNameIndex.of([]), **options)  # type: ignore[arg-type]


def only(path: Path) -> PredictedTrack:
    (track,) = read(path).tracks.values()
    return track


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "out").mkdir()
    (tmp_path / "out/ball.csv").write_text(HEAD + ROWS)
    (tmp_path / "out/events.csv").write_text("frame,time_s,kind\n100,4.0,kick\n,4.08,out\n")
    return tmp_path / "out"


class TestReadTracks:
    def test_our_own_export_is_known_and_its_gaps_are_left_out(self, folder: Path) -> None:
        found = read(folder)
        assert (found.format, [*found.tracks], found.report.problems) == ("tracks", [""], [])
        track = found.tracks[""]
        assert (track.frames, track.times) == ((100, 102), (4.0, 4.08))
        assert track.position == ((1.0, 2.0, -0.5), (1.5, 2.0, -0.6))
        assert track.sigma == ((0.1, 0.1, 0.1), None)
        assert track.events == (("kick", 100, 4.0), ("out", None, 4.08))
        assert PredictedTrack.from_json(track.to_json()) == track

    def test_a_file_alone_has_no_events(self, folder: Path, tmp_path: Path) -> None:
        alone = tmp_path / "mine.csv"
        alone.write_bytes((folder / "ball.csv").read_bytes())
        assert only(alone).events is None

    def test_stretches_are_called_by_their_folders(self, folder: Path) -> None:
        (folder / "second").mkdir()
        (folder / "ball.csv").rename(folder / "second/ball.csv")
        assert [*read(folder).tracks] == ["second"]

    def test_sigmas_of_each_axis_and_times_alone(self, tmp_path: Path) -> None:
        path = tmp_path / "ball.csv"
        path.write_text(
            "time_s,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m\n0.04,1,2,-1,0.1,0.2,0.3\n"
        )
        track = only(path)
        assert (track.frames, track.times, track.sigma) == ((None,), (0.04,), ((0.1, 0.2, 0.3),))

    @pytest.mark.parametrize(
        "text",
        [
            "Frame;Time_S;X_m;Y_m;Z_m;Sigma_m\n5;0,2;1,5;-2;-1;0,1\n",
            '"frame"\t"time_s"\t"x_m"\t"y_m"\t"z_m"\t"sigma_m"\r\n5\t0.2\t1.5\t-2\t-1\t0.1\r\n',
        ],
    )
    def test_it_is_read_as_spreadsheets_save_it(self, tmp_path: Path, text: str) -> None:
        path = tmp_path / "mine.csv"
        path.write_bytes(text.encode())
        track = only(path)
        assert (track.frames, track.times, track.position) == ((5,), (0.2,), ((1.5, -2.0, -1.0),))
        assert track.sigma == ((0.1, 0.1, 0.1),)

    @pytest.mark.parametrize("sigma", ["0", "-1"])
    def test_a_ball_without_a_right_sigma_is_kept_without_it(
        self, tmp_path: Path, sigma: str
    ) -> None:
        path = tmp_path / "ball.csv"
        path.write_text(f"frame,x_m,y_m,z_m,sigma_m\n5,0,0,-1,0.1\n6,1,2,-1,{sigma}\n")
        found = read(path)
        assert found.tracks[""].position == ((0.0, 0.0, -1.0), (1.0, 2.0, -1.0))
        assert found.tracks[""].sigma == ((0.1, 0.1, 0.1), None)
        assert "kept without it" in str(found.report.problems[0])

    @pytest.mark.parametrize(
        ("row", "words"),
        [
            ("1,0,1,2", "z_m"),
            ("1,0,1,2,ten", "z_m"),
            ("1,0,1,2,nan", "z_m"),
            (",,1,2,-1", "frame"),
            ("-4,0,1,2,-1", "not the number of a frame"),
            ("1,0,1,2,-4000", "metres from the centre mark"),
            ("5,0,1,2,-1", "has a ball in an earlier row"),
        ],
    )
    def test_what_is_wrong_is_noted_and_left_out(
        self, tmp_path: Path, row: str, words: str
    ) -> None:
        path = tmp_path / "ball.csv"
        path.write_text(f"frame,time_s,x_m,y_m,z_m,sigma_m\n5,0.2,0,0,-1,0.1\n{row}\n")
        found = read(path)
        assert len(found.tracks[""].position) == 1
        (problem,) = found.report.problems
        assert words in str(problem)
        assert problem.record == "line 3"

    def test_a_table_without_a_place_or_an_instant_is_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "ball.csv"
        path.write_text("frame,x_m,y_m\n1,2,3\n")
        with pytest.raises(DatasetFormatError, match="z_m"):
            read(path, "tracks")
        path.write_text("x_m,y_m,z_m\n1,2,3\n")
        with pytest.raises(DatasetFormatError, match="time_s"):
            read(path)

    def test_an_event_of_another_kind_is_noted(self, folder: Path) -> None:
        (folder / "events.csv").write_text("frame,kind\n100,goal\n")
        found = read(folder)
        assert found.tracks[""].events == ()
        assert "kinds are kick, bounce, out" in str(found.report.problems[0])

    def test_options_of_boxes_are_refused(self, folder: Path) -> None:
        for options in ({"size": ImageSize(10, 10)}, {"category": 3}):
            with pytest.raises(InputError, match="tracks do not use"):
                read(folder, **options)
