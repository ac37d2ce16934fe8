from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import InputError
from app.features.exports.service import export_dataset
from app.formats.cameras import read_cameras
from app.formats.coco_reader import read_coco
from app.formats.export_formats import FORMATS
from app.formats.parquet import read_parquet
from app.formats.report import ReaderReport
from app.soccer.group import Station
from tests.balls import box_around
from tests.cameras import WIDE_LENSES, wide

EXPORTS_JS = Path(__file__).parents[3] / "static/state/exports.js"
POINT = (5.0, 2.0, -0.5)


@pytest.fixture(params=WIDE_LENSES)
def lens(request) -> str:
    return request.param


@pytest.fixture
def group(make_group, lens):
    """A broadcast group whose replay was filmed through a wide lens."""
    group = make_group(7, ball=POINT)
    view = group.views[1]
    camera = wide((40.0, 12.0, -12.0), (15.0, 0.0, 0.0), lens, focal=700.0)
    station = Station(view.station.key, view.size, given=camera)
    return group.with_view(replace(view, station=station, balls=(box_around(camera, POINT),)))


def test_the_browser_offers_every_format() -> None:
    rows = re.findall(r"\{ name: '([^']+)'", EXPORTS_JS.read_text())
    assert sorted(rows) == sorted(FORMATS)


class TestWideLenses:
    @pytest.mark.parametrize("kind", ["soccernet-v3d", "sn-calibration"])
    def test_a_format_of_soccernets_cameras_names_the_view_and_writes_nothing(
        self, store, fill, group, lens, tmp_path, kind
    ) -> None:
        fill(group)
        with pytest.raises(InputError, match=f"{kind} cannot store the {lens} lens of view"):
            export_dataset(store, "demo", kind, tmp_path / "out", everything=True)
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize("kind", ["issia", "issia-3d"])
    def test_issia_has_no_place_for_a_wide_lens_and_names_the_view(
        self, store, fill, make_static, lens, tmp_path, kind
    ) -> None:
        group = make_static(10)
        camera = wide((40.0, 12.0, -12.0), (15.0, 0.0, 0.0), lens, focal=700.0)
        view = group.views[1]
        station = replace(view.station, given=camera)
        fill(group.with_view(replace(view, station=station)))
        with pytest.raises(InputError, match=f"lens of view {view.key} of group 10"):
            export_dataset(store, "demo", kind, tmp_path / "out", everything=True)

    @pytest.mark.parametrize("kind", ["soccernet-v3", "gamestate", "yolo"])
    def test_a_format_without_cameras_does_not_mind(
        self, store, fill, group, tmp_path, kind
    ) -> None:
        fill(group)
        assert export_dataset(store, "demo", kind, tmp_path / "out", everything=True).counts[
            "groups"
        ]

    def test_camera_files_bring_it_back(self, store, fill, group, lens, tmp_path) -> None:
        fill(group)
        export_dataset(store, "demo", "cameras", tmp_path / "out", everything=True)
        found = read_cameras(tmp_path / "out", ReaderReport())
        (camera,) = [camera for camera in found.values() if camera.is_wide]
        assert camera == group.views[1].station.given
        (text,) = [path.read_text() for path in tmp_path.rglob("camera_7_1.json")]
        assert json.loads(text)["lens"] == lens

    @pytest.mark.parametrize(("kind", "read"), [("coco", read_coco), ("parquet", read_parquet)])
    def test_formats_with_room_for_everything_bring_it_back(
        self, store, fill, group, tmp_path, kind, read
    ) -> None:
        fill(group)
        out = export_dataset(store, "demo", kind, tmp_path / "out", everything=True).out
        (again,) = read(out, ReaderReport())
        assert again.views[1].station.given == group.views[1].station.given
