from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from sqlalchemy import select

from app.config import Settings
from app.db.store import Store
from app.errors import JobCancelled
from app.features.findings.queries import read_import_notices
from app.features.imports.picture_check import NAMED, PictureCheck
from app.features.imports.sources import ImportSource, import_source
from app.features.queue.tables import QueueModel
from app.formats.report import ReaderReport
from app.media import video as video_index
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Group, Media, Station, View
from tests.videos import write_video

SIZE = ImageSize(128, 72)
Remarks = Callable[..., list[str]]


def write(path: Path, width: int, height: int, orientation: int = 1) -> Media:
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.new("RGB", (width, height)).save(path, exif=exif.tobytes())
    return Media(str(path))


def group_of(media: Media | None, **said: object) -> Group:
    station = Station("cam1", SIZE, lines=said.pop("lines", {}), shared=said.pop("shared", False))
    return Group("kick-1", (View("north", station, media=media, **said),))


@pytest.fixture
def check(tmp_path: Path) -> PictureCheck:
    return PictureCheck(ReaderReport(), Settings(home=tmp_path / "home"))


@pytest.fixture
def remarks_of(check: PictureCheck) -> Callable[..., list[str]]:
    def remarks(*groups: Group) -> list[str]:
        assert list(check.watch(groups)) == list(groups)
        return check.describe_differences()

    return remarks


class TestShapes:
    @pytest.mark.parametrize(("width", "height"), [(128, 72), (1280, 720), (64, 36), (1920, 1080)])
    def test_the_same_shape_in_another_resolution_is_silent(
        self, remarks_of: Remarks, width: int, height: int, tmp_path: Path
    ) -> None:
        assert remarks_of(group_of(write(tmp_path / "7.jpg", width, height))) == []

    def test_a_picture_of_another_shape_is_named(self, remarks_of: Remarks, tmp_path: Path) -> None:
        (remark,) = remarks_of(group_of(write(tmp_path / "7.jpg", 72, 128)))
        assert "1 picture has another shape than the file declares" in remark
        assert (
            "group kick-1, view north (7.jpg): 128 x 72 declared, the picture is 72 x 128, the "
            "same on its side." in remark
        )

    def test_the_size_that_people_see_counts(self, check: PictureCheck, tmp_path: Path) -> None:
        upright = group_of(write(tmp_path / "7.jpg", 72, 128, orientation=6))
        list(check.watch([upright]))
        assert check.describe_differences() == []
        assert check.report.counts["pictures turned by EXIF"] == 1

    def test_a_declared_size_of_the_stored_pixels_names_the_orientation(
        self, remarks_of: Remarks, tmp_path: Path
    ) -> None:
        (remark,) = remarks_of(group_of(write(tmp_path / "7.jpg", 128, 72, orientation=6)))
        assert "72 x 128, the same on its side (its EXIF orientation turns it)" in remark

    def test_a_picture_in_a_zip_is_looked_at(self, remarks_of: Remarks, tmp_path: Path) -> None:
        write(tmp_path / "7.jpg", 72, 128)
        with zipfile.ZipFile(tmp_path / "Frames-v3.zip", "w") as target:
            target.write(tmp_path / "7.jpg", "frames/7.jpg")
        (remark,) = remarks_of(group_of(Media(str(tmp_path / "Frames-v3.zip"), "frames/7.jpg")))
        assert "(7.jpg): 128 x 72 declared" in remark

    def test_so_is_a_video(self, remarks_of: Remarks, tmp_path: Path) -> None:
        path = tmp_path / "cam1.avi"
        video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25, (96, 96))
        for _ in range(2):
            video.write(np.zeros((96, 96, 3), np.uint8))
        video.release()
        (remark,) = remarks_of(*[group_of(Media(str(path), frame=number)) for number in range(2)])
        assert "2 pictures have another shape" in remark

    def test_a_frame_that_a_video_does_not_have_is_named(
        self, remarks_of: Remarks, tmp_path: Path
    ) -> None:
        path = tmp_path / "cam1.avi"
        video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25, (128, 72))
        for _ in range(3):
            video.write(np.zeros((72, 128, 3), np.uint8))
        video.release()
        groups = [group_of(Media(str(path), frame=number)) for number in (-1, 0, 2, 3)]
        (remark,) = remarks_of(*groups)
        assert remark.startswith(
            "2 views have no frame in the video: group kick-1, view north: frame -1 of 3 "
            "(cam1.avi); group kick-1, view north: frame 3 of 3 (cam1.avi). Check --frame-offset"
        )

    def test_how_far_a_video_is_counted_is_told(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(video_index, "_A_WORD", 10)
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 25)), frame=5)
        told: list[tuple[int, str]] = []
        settings = Settings(home=tmp_path / "home")
        check = PictureCheck(
            ReaderReport(), settings, lambda done, _, said: told.append((done, said))
        )
        groups = [group_of(None), group_of(media), group_of(media)]
        assert list(check.watch(groups)) == groups
        counting = "Counting the frames of cam1.mp4: {} so far."
        sentences = [counting.format(frames) for frames in (0, 10, 20)] + ["Reading the groups."]
        assert told == [(1, sentence) for sentence in sentences]

    def test_an_import_that_is_cancelled_counts_no_further(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(video_index, "_A_WORD", 10)
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 25)), frame=5)
        told: list[str] = []

        def progress(done: int, total: int | None, sentence: str) -> None:
            told.append(sentence)
            if len(told) == 2:
                raise JobCancelled("cancelled")

        check = PictureCheck(ReaderReport(), Settings(home=tmp_path / "home"), progress)
        with pytest.raises(JobCancelled):
            list(check.watch([group_of(media)]))
        assert told[-1] == "Counting the frames of cam1.mp4: 10 so far."

    def test_a_video_that_cannot_be_read_is_named(
        self, remarks_of: Remarks, tmp_path: Path
    ) -> None:
        (tmp_path / "cam1.mp4").write_bytes(b"no video")
        (remark,) = remarks_of(group_of(Media(str(tmp_path / "cam1.mp4"), frame=0)))
        assert "view north: cam1.mp4 is not a video that can be read." in remark

    def test_a_picture_that_cannot_be_read_is_not_compared(
        self, remarks_of: Remarks, tmp_path: Path
    ) -> None:
        (tmp_path / "7.jpg").write_bytes(b"\xff\xd8\xff\xe0 cut off")
        gone = Media(str(tmp_path / "gone.jpg"))
        assert remarks_of(group_of(Media(str(tmp_path / "7.jpg"))), group_of(gone)) == []

    def test_many_are_counted(self, remarks_of: Remarks, tmp_path: Path) -> None:
        media = write(tmp_path / "7.jpg", 72, 128)
        (remark,) = remarks_of(*[group_of(media)] * (NAMED + 3))
        assert "8 pictures have" in remark and "; and 3 more. " in remark


class TestOutside:
    @pytest.mark.parametrize("place", [(0.0, 0.0), (127.5, 71.5), (130.0, -1.0)])
    def test_what_lies_inside_or_on_the_border_is_silent(
        self, remarks_of: Remarks, place: tuple[float, float]
    ) -> None:
        ball = BallAnnotation(point=ImagePoint(*place))
        assert remarks_of(group_of(None, balls=(ball,))) == []

    def test_a_ball_a_box_and_a_point_outside_are_named(self, remarks_of: Remarks) -> None:
        ball = BallAnnotation(point=ImagePoint(640.0, 20.0))
        lines = make_lines({"Middle line": [(10.0, 10.0), (50.0, 300.0)]})
        (remark,) = remarks_of(group_of(None, balls=(ball,), lines=lines))
        assert remark.startswith(
            "1 view has annotations outside the picture: group kick-1, view north: "
            "the ball at (640, 20) and 1 more, of 128 x 72."
        )

    def test_lines_of_a_static_camera_are_named_once(self, remarks_of: Remarks) -> None:
        lines = make_lines({"Middle line": [(10.0, 10.0), (50.0, 300.0)]})
        (remark,) = remarks_of(*[group_of(None, lines=lines, shared=True)] * 3)
        assert remark.startswith("1 view has")


class TestImport:
    def test_a_declared_size_of_another_shape_stands_in_the_report(
        self, store: Store, tmp_path: Path
    ) -> None:
        write(tmp_path / "7.jpg", 128, 72)
        image = {"id": 1, "width": 72, "height": 128, "file_name": "7.jpg"}
        value = {"images": [image], "annotations": [], "categories": []}
        (tmp_path / "instances_default.json").write_text(json.dumps(value))
        imported = import_source(store, "demo", ImportSource("coco", tmp_path), store.settings)
        (remark,) = imported.to_report_values()["remarks"]
        assert "72 x 128 declared, the picture is 128 x 72" in remark

    def test_its_group_has_a_finding_until_the_size_is_right(
        self, store: Store, tmp_path: Path
    ) -> None:
        """Else a group whose gates pass would look as sound as any other."""
        write(tmp_path / "7.jpg", 128, 72)
        source = ImportSource("coco", tmp_path)

        def brought(width: int, height: int, dry_run: bool = False) -> tuple[int, list[str]]:
            image = {"id": 1, "width": width, "height": height, "file_name": "7.jpg"}
            value = {"images": [image], "annotations": [], "categories": []}
            (tmp_path / "instances_default.json").write_text(json.dumps(value))
            found = import_source(store, "demo", source, store.settings, dry_run=dry_run)
            with store.read() as session:
                noticed = read_import_notices(session, [1])[1]
                (row,) = session.execute(select(QueueModel.findings)).all()
            assert bool(row.findings.strip(",")) == bool(noticed)
            return found.to_report_values()["findings"], [
                f"{one.kind} {one.sentence}" for one in noticed
            ]

        assert brought(128, 72) == (0, [])
        assert brought(72, 128, dry_run=True) == (1, [])
        for _ in range(2):
            count, (told,) = brought(72, 128)
            assert count == 1
            assert told.startswith("picture_geometry The picture has another shape")
            assert "72 x 128 declared, the picture is 128 x 72, the same on its side" in told
        assert brought(128, 72) == (0, [])
