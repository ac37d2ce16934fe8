from __future__ import annotations

import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.config import Settings
from app.errors import InputError
from app.formats.frames_reader import parse_grouping_pattern, read_frames
from app.formats.report import ReaderReport
from app.media.images import check_size, read_header
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media


def size_of(data: bytes, name: str) -> ImageSize:
    header = read_header(data, name)
    check_size(header, Settings(max_side=500), name)
    return ImageSize(header.width, header.height)


def read(root: Path, report: ReaderReport, grouping: str = "") -> list[Group]:
    return list(read_frames(root, size_of, report, grouping=grouping))


def keys(groups: list[Group]) -> dict[str, list[str]]:
    return {group.key: [view.key for view in group.views] for group in groups}


@pytest.fixture
def shots(tmp_path: Path) -> Path:
    root = tmp_path / "shots"
    (root / "day 2").mkdir(parents=True)
    Image.new("RGB", (128, 72)).save(root / "b.jpg")
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.new("RGB", (72, 128)).save(root / "day 2" / "a.PNG", exif=exif.tobytes())
    return root


class TestReadFrames:
    def test_each_picture_is_a_group_of_one_view_of_its_own_size(
        self, shots: Path, report: ReaderReport
    ) -> None:
        first, second = read(shots, report)
        assert (first.key, second.key) == ("b.jpg", "day 2/a.PNG")
        (view,) = second.views
        assert (view.key, view.size) == ("day 2/a.PNG", ImageSize(128, 72))
        assert view.media == Media(str(shots / "day 2" / "a.PNG"))
        assert (view.balls, view.station.lines, view.station.shared) == ((), {}, False)
        assert second.label == "Image a.PNG"
        assert report.problems == []
        assert (report.read, report.imported) == (2, 2)

    def test_a_zip_and_a_single_picture_will_do(
        self, shots: Path, tmp_path: Path, report: ReaderReport
    ) -> None:
        with zipfile.ZipFile(tmp_path / "shots.zip", "w") as archive:
            archive.write(shots / "b.jpg", "x/b.jpg")
        (packed,) = read(tmp_path / "shots.zip", report)
        assert packed.views[0].media == Media(str(tmp_path / "shots.zip"), "x/b.jpg")
        (alone,) = read(shots / "b.jpg", report)
        assert alone.key == "b.jpg"
        assert report.problems == []

    def test_what_is_no_picture_is_named_and_files_of_the_system_are_not(
        self, shots: Path, report: ReaderReport
    ) -> None:
        for name in ("notes.txt", "iphone.heic", "Thumbs.db", ".DS_Store", "match.mp4"):
            (shots / name).write_bytes(b"x")
        (shots / "c.jpg").write_bytes(b"\xff\xd8\xff\xe0 cut off")
        Image.new("RGB", (600, 10)).save(shots / "wide.png")
        assert len(read(shots, report)) == 2
        told = {Path(problem.path).name: problem.problem for problem in report.problems}
        assert sorted(told) == ["c.jpg", "iphone.heic", "match.mp4", "notes.txt", "wide.png"]
        assert told["match.mp4"].startswith("is a video: bring it in as a recording")
        assert told["notes.txt"] == "is not a JPEG, PNG or WebP picture"
        assert told["c.jpg"] == "is damaged in its header"
        assert told["wide.png"].startswith("declares 600 x 10 pixels")

    def test_a_png_that_is_cut_off_is_named(self, tmp_path: Path, report: ReaderReport) -> None:
        noise = np.random.default_rng(1).integers(0, 255, (200, 300, 3)).astype(np.uint8)
        Image.fromarray(noise).save(tmp_path / "whole.png")
        whole = (tmp_path / "whole.png").read_bytes()
        (tmp_path / "cut.png").write_bytes(whole[: len(whole) // 2])
        assert [group.key for group in read(tmp_path, report)] == ["whole.png"]
        (problem,) = report.problems
        assert problem.problem == "is cut off: the end of its picture is missing"

    def test_jfif_is_a_jpeg(self, shots: Path, report: ReaderReport) -> None:
        (shots / "b.jpg").rename(shots / "b.jfif")
        assert "b.jfif" in [group.key for group in read(shots, report)]
        assert report.problems == []

    def test_a_jpeg_that_is_cut_off_is_named(self, tmp_path: Path, report: ReaderReport) -> None:
        thumbnail, noise = BytesIO(), np.random.default_rng(1).integers(0, 255, (200, 300, 3))
        Image.new("RGB", (16, 9)).save(thumbnail, "JPEG")
        Image.fromarray(noise.astype(np.uint8)).save(
            tmp_path / "whole.jpg", exif=b"Exif\0\0" + thumbnail.getvalue()
        )
        whole = (tmp_path / "whole.jpg").read_bytes()
        (tmp_path / "cut.jpg").write_bytes(whole[: len(whole) // 2])
        (tmp_path / "live.jpg").write_bytes(whole + bytes(10_000))
        assert [group.key for group in read(tmp_path, report)] == ["live.jpg", "whole.jpg"]
        (problem,) = report.problems
        assert (Path(problem.path).name, problem.problem) == (
            "cut.jpg",
            "is cut off: the end of its picture is missing",
        )

    def test_a_folder_without_pictures_says_so(self, tmp_path: Path, report: ReaderReport) -> None:
        assert read(tmp_path, report) == []
        (problem,) = report.problems
        assert problem.problem == "contains no picture (JPEG, PNG or WebP)"

    def test_a_large_profile_before_the_size_is_passed_over(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        Image.new("RGB", (128, 72)).save(tmp_path / "a.jpg", icc_profile=bytes(200_000))
        (group,) = read(tmp_path, report)
        assert group.views[0].size == ImageSize(128, 72)


class TestGrouping:
    @pytest.fixture
    def instants(self, tmp_path: Path) -> Path:
        root = tmp_path / "instants"
        for name in ("1_main.jpg", "1_goal.JPG", "2_main.jpg", "poster.png", "late/1_main.jpg"):
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            Image.new("RGB", (128, 72)).save(root / name)
        return root

    def test_pictures_of_a_folder_are_one_group(self, instants: Path, report: ReaderReport) -> None:
        assert keys(read(instants, report, "folder")) == {
            "pictures": ["1_goal.JPG", "1_main.jpg", "2_main.jpg", "poster.png"],
            "late": ["1_main.jpg"],
        }
        assert report.remarks == [
            "Grouped by folder: 5 pictures in 2 groups; for example pictures: 1_goal.JPG, "
            "1_main.jpg, 2_main.jpg, poster.png."
        ]

    def test_a_pattern_groups_by_the_instant_within_a_folder(
        self, instants: Path, report: ReaderReport
    ) -> None:
        groups = read(instants, report, "{instant}_{camera}.jpg")
        assert keys(groups) == {
            "1": ["1_goal.JPG", "1_main.jpg"],
            "2": ["2_main.jpg"],
            "late/1": ["1_main.jpg"],
            "poster.png": ["poster.png"],
        }
        assert len({view.station.key for group in groups for view in group.views}) == 5
        assert report.remarks[1:] == [
            "1 picture does not fit {instant}_{camera}.jpg: each is a group of its own."
        ]

    @pytest.mark.parametrize(
        "grouping",
        ["folders", "{instant}.jpg", "{instant}_{camera}_{camera}", "{a}{instant}{camera}"],
    )
    def test_what_is_no_pattern_is_refused(self, grouping: str) -> None:
        with pytest.raises(InputError, match=r"contains \{instant\} and \{camera\}"):
            parse_grouping_pattern(grouping)

    def test_letters_of_patterns_mean_themselves(self) -> None:
        pattern = parse_grouping_pattern("cam({camera}) {instant}.png")
        assert pattern is not None
        found = pattern.fullmatch("cam(a.b) 00:17.png")
        assert found is not None
        assert (found["instant"], found["camera"]) == ("00:17", "a.b")
