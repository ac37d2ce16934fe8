from __future__ import annotations

import errno
import hashlib
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.errors import InputError
from app.formats.report import ReaderReport
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.sample.scene import read_truth
from app.sample.write import write_sample
from tests.scenes import make_scenes


def _digests(root: Path) -> dict[str, str]:
    files = sorted(path for path in root.rglob("*") if path.is_file())
    return {
        str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files
    }


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sample")
    write_sample(out, groups=2, seed=21, workers=1)
    return out


class TestWriteSample:
    def test_every_match_has_labels_and_frames(self, written: Path):
        names = sorted(path.name for path in written.rglob("*") if path.is_file())
        assert names == ["Frames-v3.zip"] * 2 + ["Labels-v3.json"] * 2 + ["truth.json"]

    def test_frames_are_images_of_the_annotated_size(self, written: Path):
        with zipfile.ZipFile(next(written.rglob("Frames-v3.zip"))) as frames:
            assert frames.namelist()[:2] == ["0.png", "0_1.png"]
            content = np.frombuffer(frames.read("0.png"), np.uint8)
        assert cv2.imdecode(content, cv2.IMREAD_COLOR).shape == (720, 1280, 3)

    def test_two_processes_write_the_same_bytes_as_one(self, written: Path, tmp_path: Path):
        write_sample(tmp_path, groups=2, seed=21, workers=2)
        assert _digests(tmp_path) == _digests(written)

    def test_what_is_read_back_is_what_was_made(self, written: Path):
        report = ReaderReport()
        groups = {group.key: group for group in read_soccernet_v3(written, report)}
        assert not report.problems
        scenes = make_scenes(2, 21)
        assert set(groups) == {scene.group.key for scene in scenes}
        for scene in scenes:
            read = groups[scene.group.key]
            assert (read.label, read.split, read.match) == (
                scene.group.label,
                scene.group.split,
                scene.group.match,
            )
            for view, made in zip(read.views, scene.group.views, strict=True):
                assert view.key == made.key
                assert view.station == made.station
                assert view.balls == made.balls
                assert view.extras.boxes == made.extras.boxes
                assert view.media is not None
                assert view.media.member == view.key

    def test_the_truth_comes_back_to_the_last_digit(self, written: Path):
        truth = read_truth(written)
        assert truth == {scene.truth.key: scene.truth for scene in make_scenes(2, 21)}

    def test_labels_alone_of_fifty_groups(self, tmp_path: Path):
        seen: list[tuple[int, int]] = []
        report = write_sample(
            tmp_path, groups=50, seed=3, labels_only=True, workers=1,
            progress=lambda done, total: seen.append((done, total)),
        )  # fmt: skip
        assert (report.matches, report.groups) == (4, 50)
        assert seen[-1] == (50, 50)
        assert not list(tmp_path.rglob("*.zip"))
        groups = list(read_soccernet_v3(tmp_path, ReaderReport()))
        assert len(groups) == 50
        assert sum(len(group.views) for group in groups) == report.views
        assert {group.split for group in groups} == {"train", "valid", "test"}

    def test_no_faults_when_none_are_wanted(self, tmp_path: Path):
        report = write_sample(tmp_path, 20, 3, labels_only=True, faults=False, workers=1)
        assert report.faults == 0
        assert not any(truth.faults for truth in read_truth(tmp_path).values())

    @pytest.mark.parametrize("there", [False, True])
    def test_an_interrupted_one_leaves_what_was_there_and_no_more(
        self, tmp_path: Path, there: bool
    ) -> None:
        out = tmp_path / "deep" / "out"
        if there:
            out.mkdir(parents=True)
            (out / "mine.txt").write_text("mine")
        before = sorted(tmp_path.rglob("*"))

        def interrupt(*_: object) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            write_sample(out, 20, 3, labels_only=True, workers=1, progress=interrupt)
        assert sorted(tmp_path.rglob("*")) == before

    def test_a_disk_that_fills_while_files_are_moved_is_told_as_that(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ):
        move, moved = Path.replace, []

        def fill(path: Path, target: Path) -> Path:
            if moved and tmp_path / "new" in target.parents:
                raise OSError(errno.ENOSPC, "No space left on device")
            moved.extend([path] if target.name == "Labels-v3.json" else [])
            return move(path, target)

        monkeypatch.setattr(Path, "replace", fill)
        with pytest.raises(InputError, match=r"new/out cannot be written \(No space left"):
            write_sample(tmp_path / "new" / "out", 20, 3, labels_only=True, workers=1)
        assert len(moved) == 1

    def test_a_file_in_the_way_is_named(self, tmp_path: Path):
        file = tmp_path / "occupied"
        file.write_text("x")
        with pytest.raises(InputError, match="occupied"):
            write_sample(file, groups=1)

    def test_a_sample_of_nothing_is_refused(self, tmp_path: Path):
        with pytest.raises(InputError, match="at least one group"):
            write_sample(tmp_path, groups=0)
