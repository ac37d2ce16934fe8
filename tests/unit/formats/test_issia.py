"""People of ISSIA's cameras 2 and 6, who are mirrored in the files: turned where the files say so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.formats.camera_json import camera_to_json
from app.formats.issia import MIRRORED, find_cameras_with_mirrored_people, mirror_people
from app.formats.issia_reader import IssiaFolder, IssiaOptions, open_issia
from app.formats.issia_writer import write_issia
from app.formats.report import ReaderReport
from app.formats.viper_reader import ViperVideo
from app.geometry.camera import Camera
from tests.cameras import looking

WIDTH = 1920
CAMERAS = {
    1: looking((-20.0, 60.0, -15.0), (-30.0, 0.0, 0.0), 1400.0),
    2: looking((-40.0, -55.0, -12.0), (-30.0, 0.0, 0.0), 1400.0),
}
PEOPLE = [(x, y) for x in (-38.0, -33.0, -27.0) for y in (-12.0, -5.0, 6.0, 14.0)]


def boxes(camera: Camera) -> list[tuple[str, float, float, float, float]]:
    """Boxes of 20 x 50 px of the people, whose feet are where the camera sees them."""
    feet = camera.project(np.array([(x, y, 0.0) for x, y in PEOPLE]))
    return [(str(n), x - 10.0, y - 50.0, 20.0, 50.0) for n, (x, y) in enumerate(feet.tolist())]


def seen(number: int, *, mirrored: bool, source: str = "file://C:/a.mpg") -> ViperVideo:
    """What a camera shows of the people in two frames."""
    track = ViperVideo(persons={f: boxes(CAMERAS[number]) for f in (20, 21)}, source=source)
    return mirror_people(track, WIDTH) if mirrored else track


def asked(number: int, track: ViperVideo, given: dict[int, Camera]) -> list[int]:
    tracks = {1: seen(1, mirrored=False), number: track}
    return find_cameras_with_mirrored_people(tracks, given, dict.fromkeys(tracks, WIDTH))


class TestTurned:
    def test_columns_become_those_that_they_are_in_the_mirror(self):
        """A box covers columns x to x + width - 1; those of a mirror are W - 1 - x."""
        (box,) = mirror_people(ViperVideo(persons={0: [("7", 0.0, 3.0, 10.0, 20.0)]}), 100).persons[
            0
        ]
        assert box == ("7", 90.0, 3.0, 10.0, 20.0)
        columns = {100 - 1 - column for column in range(10)}
        assert columns == set(range(90, 100))

    def test_twice_is_as_written(self):
        track = seen(2, mirrored=False)
        again = mirror_people(mirror_people(track, WIDTH), WIDTH)
        assert np.array(again.persons[20])[:, 1:].astype(float) == pytest.approx(
            np.array(track.persons[20])[:, 1:].astype(float)
        )


class TestMirroredPeople:
    @pytest.mark.parametrize("source", ["file://C:/pierlus2.mpg", "cam2.mp4"])
    def test_who_stands_at_one_place_only_when_turned_is_turned(self, source: str):
        assert asked(2, seen(2, mirrored=True, source=source), CAMERAS) == [2]

    @pytest.mark.parametrize("source", ["file://C:/pierlus2.mpg", "cam2.mp4"])
    def test_who_stands_at_one_place_as_written_is_not(self, source: str):
        assert asked(2, seen(2, mirrored=False, source=source), CAMERAS) == []

    def test_without_cameras_all_files_are_mirrored_but_those_written_here(self):
        assert asked(2, seen(2, mirrored=True), {}) == [2]
        assert asked(2, seen(2, mirrored=False, source="cam2.mp4"), {}) == []

    def test_other_cameras_are_what_they_are(self):
        tracks = {1: seen(1, mirrored=False), 3: seen(2, mirrored=True)}
        given = {1: CAMERAS[1], 3: CAMERAS[2]}
        assert find_cameras_with_mirrored_people(tracks, given, dict.fromkeys(tracks, WIDTH)) == []
        assert {2, 6} == MIRRORED


def xgtf(track: ViperVideo) -> str:
    people = "".join(
        f'<object name="Person" id="{name}"><attribute name="LOCATION">'
        + "".join(
            f'<data:bbox framespan="{f}:{f}" x="{x}" y="{y}" width="{w}" height="{h}"/>'
            for f, all_ in track.persons.items()
            for other, x, y, w, h in all_
            if other == name
        )
        + "</attribute></object>"
        for name in [box[0] for box in track.persons[20]]
    )
    return (
        '<viper xmlns="http://lamp.cfar.umd.edu/viper#"'
        ' xmlns:data="http://lamp.cfar.umd.edu/viperdata#"><data>'
        f'<sourcefile filename="{track.source}"><object name="BALL" id="0"><attribute name="BallPos">'
        '<data:point framespan="20:20" x="300" y="50"/></attribute></object>'
        f"{people}</sourcefile></data></viper>"
    )


def issia_folder(root: Path) -> Path:
    """Two cameras, the people of the second mirrored; the ball in the first of two frames."""
    root.mkdir()
    for number in CAMERAS:
        text = xgtf(seen(number, mirrored=number == 2))
        (root / f"ground_truth_{number}.xgtf").write_text(text)
    given = {f"cam{number}": camera_to_json(camera) for number, camera in CAMERAS.items()}
    (root / "issia_calibration.json").write_text(json.dumps(given))
    return root


def people(folder: IssiaFolder) -> list[float]:
    (group,) = folder.groups()
    (view,) = [view for view in group.views if view.key == "cam2"]
    (unassigned,) = [item for item in folder.persons_without_ball() if item.camera == "cam2"]
    return [box["points"]["x1"] for box in (*view.extras.boxes, *unassigned.boxes)]


class TestReading:
    def test_boxes_are_turned_and_balls_are_not_and_it_is_said(self, tmp_path: Path):
        report = ReaderReport()
        folder = open_issia(issia_folder(tmp_path / "issia"), IssiaOptions(), report)
        right = [box[1] for box in boxes(CAMERAS[2])]
        assert sorted(people(folder)) == pytest.approx(sorted([*right, *right]), abs=1e-6)
        (group,) = folder.groups()
        assert [ball.center for view in group.views for ball in view.balls] == [(300, 50)] * 2
        assert [text for text in report.remarks if text.startswith("People of cam2 are turned")]

    def test_what_is_written_again_is_not_turned_once_more(self, tmp_path: Path):
        folder = open_issia(issia_folder(tmp_path / "issia"), IssiaOptions(), ReaderReport())
        (tmp_path / "out").mkdir()
        write_issia(tmp_path / "out", folder.groups(), folder.persons_without_ball())
        for given in (True, False):
            if not given:
                (tmp_path / "out" / "issia_calibration.json").unlink()
            report = ReaderReport()
            again = open_issia(tmp_path / "out", IssiaOptions(), report)
            assert people(again) == pytest.approx(people(folder))
            assert not [text for text in report.remarks if "turned" in text]
