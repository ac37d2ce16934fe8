from __future__ import annotations

import pytest

from app.evaluation.frame import FrameNameIndex, NamedFrame
from app.formats.frame_names import frame_path_by_match, frame_path_in_split
from app.formats.gamestate_reader import sequence_frame_path
from app.formats.sn_calibration import line_frame_path
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

SIZE = ImageSize(1280, 720)
ALDER = "league/2030-2031/2030-08-17 - 18-00 Alder 3 - 1 Birch"
CEDAR = "league/2030-2031/2030-08-24 - 18-00 Cedar 0 - 0 Birch"


def broadcast(identity: int, match: str, view: str) -> NamedFrame:
    return NamedFrame(identity, f"{match}/7.png", view, match, SIZE)


@pytest.fixture
def names() -> FrameNameIndex:
    return FrameNameIndex.of(
        [
            broadcast(1, ALDER, "7.png"),
            broadcast(2, ALDER, "7_1.png"),
            broadcast(3, CEDAR, "7.png"),
            NamedFrame(4, "358", "cam3", "issia", SIZE, station="cam3"),
            NamedFrame(5, "359", "cam3", "issia", SIZE, station="cam3"),
        ]
    )


class TestFind:
    @pytest.mark.parametrize(
        "name",
        [
            f"{ALDER}/7_1.png",
            f"{ALDER}/7_1",
            f"{ALDER.rsplit('/', 1)[1]}/7_1.jpg",
            f"labels/test/{ALDER}/7_1.txt",
            f"{ALDER}/Frames-v3/7_1.png",
            ALDER.replace("/", "_") + "_7_1.txt",
            "7_1.png",
            "predictions/7_1.txt",
            "runs/detect/predict2/labels/7_1.txt",
            f"/data/frames of mine/{ALDER}/7_1.png",
            f"C:\\frames\\{ALDER}\\7_1.png",
            f"mine/{ALDER.rsplit('/', 1)[1]}/7_1.png",
        ],
    )
    def test_knows_the_spellings_of_a_broadcast_frame(self, names, name: str) -> None:
        assert names.find(name).id == 2

    @pytest.mark.parametrize(
        "name",
        [
            "cam3/358.jpg",
            "358/cam3",
            "358_cam3.txt",
            "labels/cam3_358.txt",
            "/data/issia/cam3/358.png",
        ],
    )
    def test_knows_the_spellings_of_a_static_frame(self, names, name: str) -> None:
        assert names.find(name).id == 4

    def test_knows_what_exports_call_it(self, names) -> None:
        group, view = Group(f"{ALDER}/7.png", (), match=ALDER), View("7_1.png", Station("x", SIZE))
        for place in (
            frame_path_by_match,
            frame_path_in_split,
            line_frame_path,
            sequence_frame_path,
        ):
            assert names.find(place(group, view, "test", ".jpg")).id == 2
        label = frame_path_in_split(group, view, "test", ".jpg").replace("images/", "labels/")
        assert names.find(label.rsplit(".", 1)[0] + ".txt").id == 2

    def test_a_name_that_fits_several_is_none_of_them(self, names) -> None:
        assert names.find("7.png") is None
        assert "several" in names.explain_unknown_name("7.png")
        assert names.find(f"{CEDAR}/7.png").id == 3

    def test_a_frame_of_another_match_is_not_the_one_of_that_number(self, names) -> None:
        other = "league/2030-2031/2030-09-01 - 18-00 Fir 1 - 0 Oak/7_1.png"
        assert names.find(other) is None
        assert names.explain_unknown_name(other).startswith(
            "is not a frame of the dataset: its folders name no group"
        )
        assert names.explain_unknown_name("99.png") == "is not a frame of the dataset"

    @pytest.mark.parametrize(
        "name",
        [
            "epl/2014-2015/Arsenal/7_1.png",
            "Arsenal/7_1.png",
            "labels/Arsenal/7_1.txt",
            "Arsenal/Frames-v3/7_1.png",
            "Arsenal/labels/7_1.txt",
            "other/cam3/358.jpg",
            "other/cam3_358.txt",
        ],
    )
    def test_folders_that_may_be_another_match_are_not_passed_over(self, names, name: str) -> None:
        assert names.find(name) is None

    def test_the_last_folder_alone_of_a_match_without_teams_does_not_tell_it(self) -> None:
        found = FrameNameIndex.of([broadcast(1, "epl/2015-2016/Arsenal", "2_2.png")])
        assert found.find("Arsenal/2_2.png").id == 1
        assert found.find("x/epl/2015-2016/Arsenal/2_2.png").id == 1
        assert found.find("epl/2014-2015/Arsenal/2_2.png") is None

    def test_where_frames_have_no_match_their_group_tells_them(self) -> None:
        found = FrameNameIndex.of(
            [
                NamedFrame(1, "g7", "7_1.png", "", SIZE),
                NamedFrame(2, "358", "cam3", "", SIZE, station="cam3"),
            ]
        )
        assert [found.find(name).id for name in ("7_1", "labels/7_1", "x/g7/7_1")] == [1, 1, 1]
        assert found.find("x/cam3/358.jpg").id == 2
        assert found.find("x/7_1.png") is None

    @pytest.mark.parametrize(
        "name",
        [
            "/home/me/data/images/0004.jpg",
            "C:\\me\\images\\0004.jpg",
            "file:///x/0004.jpg",
            "../images/0004.jpg",
            "/content/dataset/test/images/0004.txt",
            "https://example.org/files/0004.jpg",
        ],
    )
    def test_where_views_alone_tell_frames_apart_folders_say_nothing(self, name: str) -> None:
        frames = [NamedFrame(n, f"000{n}.jpg", f"000{n}.jpg", "", SIZE) for n in (4, 5)]
        assert FrameNameIndex.of(frames).find(name).id == 4

    def test_a_folder_called_like_a_match_is_not_passed_over(self) -> None:
        frames = [NamedFrame(n, f"000{n}.jpg", f"000{n}.jpg", "", SIZE) for n in (4, 5)]
        index = FrameNameIndex.of(frames)
        assert index.find("2015-02-21 - 18-00 Chelsea 1 - 1 Burnley/0004.jpg") is None

    def test_folders_tell_groups_apart_whose_views_are_called_alike(self) -> None:
        frames = [
            NamedFrame(n, f"kick-{n}", view, "", SIZE)
            for n, view in ((1, "north.jpg"), (2, "north.jpg"), (3, "east.jpg"))
        ]
        index = FrameNameIndex.of(frames)
        assert index.find("x/kick-2/north.jpg").id == 2
        assert index.find("kick-4/east.jpg") is None
        assert FrameNameIndex.of(frames[:1]).find("kick-4/north.jpg") is None

    def test_a_view_with_folders_of_its_own_is_found_below_others(self) -> None:
        frames = [NamedFrame(n, f"task_{n}/0.png", f"task_{n}/0.png", "", SIZE) for n in (1, 2)]
        index = FrameNameIndex.of(frames)
        assert index.find("/home/me/task_2/0.png").id == 2
        assert index.find("/home/me/task_3/0.png") is None

    def test_a_folder_of_a_view_that_holds_files_of_any_match_does_not_tell_it(self) -> None:
        view = "img1/000001.jpg"
        index = FrameNameIndex.of([NamedFrame(1, view, view, "", SIZE)])
        assert index.find(view).id == 1
        assert index.find("SNMOT-061/img1/000001.jpg") is None

    def test_the_path_of_its_picture_is_a_name_of_every_frame(self) -> None:
        frames = [
            NamedFrame(n, "7.png", f"7_{n}.png", ALDER, SIZE, path=f"/mine/{n}/a b.jpg")
            for n in (1, 2)
        ]
        index = FrameNameIndex.of(frames)
        assert index.find("/mine/2/a b.jpg").id == 2
        assert index.find("file:///mine/2/a%20b.jpg").id == 2
        assert index.find("/theirs/2/a b.jpg") is None


class TestOfStation:
    def test_a_picture_of_a_static_camera_may_have_zeros_before_its_frame(self, names) -> None:
        assert names.find("cam3/000358.jpg").id == 4
        assert names.find("issia/cam3/0359.png").id == 5
        assert names.find("cam3/000999.jpg") is None

    def test_is_every_frame_of_the_camera(self, names) -> None:
        assert names.find_station_frames("camera/cam3.json") == (4, 5)
        assert names.find_station_frames("cam9") == ()


class TestFindNumber:
    @pytest.fixture
    def pictures(self) -> FrameNameIndex:
        return FrameNameIndex.of(
            [
                NamedFrame(1, "kick0", "north", "", SIZE, picture="images/0004.jpg"),
                NamedFrame(2, "kick0", "south", "", SIZE, picture="images/frame_000005.jpg"),
                NamedFrame(3, "kick1", "0006.jpg", "", SIZE),
                NamedFrame(4, "kick1", "south", "", SIZE, picture="other/0007.jpg"),
                NamedFrame(5, "kick2", "south", "", SIZE, picture="another/0007.jpg"),
            ]
        )

    @pytest.mark.parametrize(
        ("text", "found"),
        [
            ("4", 1),
            ("0004", 1),
            ("4.0", 1),
            ("4.00", 1),
            ("5", 2),
            ("6", 3),
            ("7", None),
            ("x", None),
            ("9" * 5000, None),
            ("²", None),
        ],
    )
    def test_a_number_is_that_in_the_name_of_a_picture(
        self, pictures: FrameNameIndex, text: str, found: int | None
    ) -> None:
        frame = pictures.find_by_number(text)
        assert (frame and frame.id) == found

    def test_says_why_there_is_none(self, pictures: FrameNameIndex) -> None:
        assert "several frames" in pictures.explain_unknown_number("7")
        assert "is not a number that the name" in pictures.explain_unknown_number("99")

    @pytest.mark.parametrize(
        ("name", "found"), [("0004.jpg", 1), ("other/0007.jpg", 4), ("0007.jpg", None)]
    )
    def test_pictures_are_names_too(
        self, pictures: FrameNameIndex, name: str, found: int | None
    ) -> None:
        frame = pictures.find(name)
        assert (frame and frame.id) == found

    def test_views_of_one_match_that_are_called_alike_are_one_camera(
        self, pictures: FrameNameIndex
    ) -> None:
        assert pictures.find_station_frames("south") == (2, 4, 5)

    def test_a_folder_that_names_no_group_is_passed_over_where_it_holds_files_of_any(
        self, pictures: FrameNameIndex
    ) -> None:
        for name in ("cameras/south", "run/south", "test-960x540/camera/south"):
            assert pictures.find_station_frames(name, "run") == (2, 4, 5), name
        for name in ("kick99/south", "run/kick99/south"):
            assert pictures.find_station_frames(name, "run") == (), name
            assert "name no group or match" in pictures.explain_unknown_name(name)
        assert pictures.find("kick1/south").id == 4
        assert pictures.find_station_frames("clip/north") == (1,)

    def test_a_numbered_folder_names_a_group_where_groups_are_called_so(self) -> None:
        frames = [NamedFrame(n, f"frame_{n}", "south", "", SIZE) for n in (1, 2)]
        index = FrameNameIndex.of(frames)
        assert index.find_station_frames("frame_99/south") == ()
        assert index.find_station_frames("run3/frames/south") == (1, 2)
