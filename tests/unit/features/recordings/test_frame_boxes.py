"""What detectors say of frames of a recording that are of no group: kept, and candidates where a ball is followed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.db.store import Store
from app.errors import InputError, NotFoundError, StorageError
from app.features.datasets.queries import list_unused_frame_files
from app.features.predictions.detect import OnnxModel
from app.features.recordings.follow import collect_follow_hints
from app.features.recordings.frame_boxes import (
    MOST,
    detect_in_frames,
    find_recording,
    import_boxes_from_file,
    read_detected_balls_in_frames,
)
from app.features.recordings.service import Recording
from tests.drawn_balls import FRAMES, WALL, place, write_film
from tests.evaluation.tiny_detector import write_tiny_detector

Run = Callable[..., tuple[int, str, str]]
EVERY = range(FRAMES)


@pytest.fixture
def film(tmp_path: Path, touchline: Run) -> str:
    """A recording of the dataset *cup*, none of whose frames is a group."""
    film = write_film(tmp_path / "ball.avi")
    code, _, complaint = touchline("import", "video", film, "--dataset", "cup")
    assert code == 0, complaint
    return "ball"


@pytest.fixture
def store(home: Path, film: str) -> Iterator[Store]:
    with closing(Store.open(Settings(home=home))) as found:
        yield found


@pytest.fixture
def recording(store: Store, film: str) -> Recording:
    return find_recording(store, "cup", film)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> OnnxModel:
    path = tmp_path_factory.mktemp("model") / "tiny.onnx"
    return OnnxModel.open(write_tiny_detector(path, 224, 128))


def written(path: Path, *rows: tuple[float, ...]) -> Path:
    """A file of boxes."""
    lines = [",".join(str(value) for value in row) for row in rows]
    path.write_text("\n".join(["frame,x,y,w,h,score", *lines]) + "\n")
    return path


class TestFile:
    def test_its_boxes_are_candidates_of_frames_without_a_group(
        self, store: Store, recording: Recording, tmp_path: Path
    ) -> None:
        path = written(tmp_path / "seen.csv", (8, 104, 62, 9, 9, 0.8), (900, 1, 1, 9, 9, 0.9))
        kept = import_boxes_from_file(store, recording, path, "seen", min_score=0.1, actor="ann")
        assert (kept.boxes, kept.frames, kept.unknown) == (1, 1, 1)
        (one,) = collect_follow_hints(store, recording, EVERY).detected[8]
        assert (one.x, one.y, one.diameter, one.score) == (108.5, 66.5, 9.0, 0.8)
        assert collect_follow_hints(store, recording, range(9, FRAMES)).detected == {}

    def test_rows_that_are_left_out_are_named(
        self, store: Store, recording: Recording, tmp_path: Path
    ) -> None:
        path = written(tmp_path / "seen.csv", (8, 104, 62, 9, 9, 0.8), (8, 104, 62, -9, 9, 0.8))
        kept = import_boxes_from_file(store, recording, path, "seen", min_score=0.1, actor="ann")
        (problem,) = kept.problems
        assert (problem["file"], problem["record"]) == ("seen.csv", "line 3")
        assert (kept.boxes, kept.more_problems) == (1, 0)

    def test_a_set_takes_the_place_of_one_of_its_name_and_stands_beside_others(
        self, store: Store, recording: Recording, tmp_path: Path
    ) -> None:
        for name, x in (("one", 10), ("other", 20), ("one", 30)):
            path = written(tmp_path / "seen.csv", (4, x, 62, 8, 8, 0.5))
            import_boxes_from_file(store, recording, path, name, min_score=0.1, actor="ann")
        found = read_detected_balls_in_frames(store.settings, recording, EVERY)
        assert [ball.x for ball in found[4]] == [24.0, 34.0]

    def test_the_surest_of_a_frame_are_kept(
        self, store: Store, recording: Recording, tmp_path: Path
    ) -> None:
        rows = [(4, 10 * number, 62, 8, 8, number / 10) for number in range(1, 9)]
        path = written(tmp_path / "many.csv", *rows)
        import_boxes_from_file(store, recording, path, "many", min_score=0.1, actor="ann")
        scores = [
            ball.score
            for ball in read_detected_balls_in_frames(store.settings, recording, EVERY)[4]
        ]
        assert scores == [0.8, 0.7, 0.6, 0.5, 0.4][:MOST]

    def test_of_other_frames_is_refused(
        self, store: Store, recording: Recording, tmp_path: Path
    ) -> None:
        path = written(tmp_path / "far.csv", (900, 1, 1, 9, 9, 0.9))
        with pytest.raises(InputError, match='no box for any frame of "ball"'):
            import_boxes_from_file(store, recording, path, "far", min_score=0.1, actor="ann")

    def test_lies_beside_the_index_and_is_told_where_it_is_damaged(
        self, store: Store, recording: Recording, tmp_path: Path
    ) -> None:
        path = written(tmp_path / "seen.csv", (8, 104, 62, 9, 9, 0.8))
        import_boxes_from_file(store, recording, path, "seen", min_score=0.1, actor="ann")
        with store.read() as session:
            assert list_unused_frame_files(session, store.settings) == []
        (kept,) = store.settings.recordings.glob("*.balls.npz")
        kept.write_bytes(b"no boxes")
        with pytest.raises(StorageError, match="detections of ball are damaged"):
            read_detected_balls_in_frames(store.settings, recording, EVERY)


class TestDetector:
    def test_finds_the_ball_where_it_is(
        self, store: Store, recording: Recording, model: OnnxModel
    ) -> None:
        told: list[int] = []
        kept = detect_in_frames(
            store, recording, model, "tiny", range(2, 20),
            min_score=0.2, actor="ann", progress=lambda done, *_: told.append(done),
        )  # fmt: skip
        assert kept.looked_at == 18 and told == list(range(18))
        found = read_detected_balls_in_frames(store.settings, recording, EVERY)
        assert set(found) <= set(range(2, 20))
        near = [
            min(np.hypot(ball.x - x, ball.y - y) for ball in found[frame])
            for frame in range(2, 20)
            if frame not in WALL and frame in found
            for x, y in [place(frame)]
        ]
        assert len(near) > 10 and np.median(near) < 1.5

    def test_looks_at_frames_that_there_are(
        self, store: Store, recording: Recording, model: OnnxModel
    ) -> None:
        with pytest.raises(InputError, match=f"has the frames 0 to {FRAMES - 1}"):
            detect_in_frames(
                store, recording, model, "tiny", range(20, 90), min_score=0.2, actor="ann"
            )


class TestCommand:
    def test_takes_boxes_of_a_recording(
        self, touchline: Run, film: str, home: Path, tmp_path: Path
    ) -> None:
        path = written(tmp_path / "seen.csv", (8, 104, 62, 9, 9, 0.8))
        asked = ("detect", "--dataset", "cup", "--recording", film, "--boxes", path)
        code, told, complaint = touchline(*asked, "--json")
        assert code == 0, complaint
        assert json.loads(told)["boxes"] == 1
        assert "1 box in 1 of 30 frames of ball" in touchline(*asked)[1]

    def test_refuses_what_does_not_go_together(
        self, touchline: Run, film: str, tmp_path: Path
    ) -> None:
        path = written(tmp_path / "seen.csv", (8, 104, 62, 9, 9, 0.8))
        film_of = ("detect", "--dataset", "cup", "--recording", film)
        for wrong in (
            ("detect", "--dataset", "cup"),
            ("detect", "--dataset", "cup", "--boxes", path),
            (*film_of, "--boxes", path, "--missing"),
            (*film_of, "--boxes", path, "--frames", "3-5"),
            (*film_of, "--boxes", path, "--frames", "early"),
        ):
            assert touchline(*wrong)[0] == 2, wrong
        code, _, complaint = touchline(
            "detect", "--dataset", "cup", "--recording", "gone", "--boxes", path
        )
        assert (code, 'no recording "gone"' in complaint) == (1, True)


def test_a_recording_of_another_name_is_not_found(store: Store) -> None:
    with pytest.raises(NotFoundError):
        find_recording(store, "cup", "semifinal")
