"""FiftyOne, where the package is installed; its database is one in memory, where mongomock is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import touchline
from touchline.errors import DataError, MissingPackageError
from touchline.fiftyone import _polylines, _written, to_fiftyone, to_samples


@pytest.fixture
def database(monkeypatch: pytest.MonkeyPatch) -> None:
    """A database of FiftyOne without a server; it holds datasets and joins no collections."""
    mongomock, mongoengine = pytest.importorskip("mongomock"), pytest.importorskip("mongoengine")
    pytest.importorskip("fiftyone")
    from fiftyone.core.odm import database

    mongoengine.disconnect_all()
    client = mongomock.MongoClient
    mongoengine.connect("fiftyone", mongo_client_class=client, uuidRepresentation="standard")
    monkeypatch.setattr(database, "_client", mongoengine.get_connection())
    monkeypatch.setattr(database, "_connect", lambda: None)


class TestToFiftyone:
    def test_the_package_is_asked_for_where_it_is_not(
        self, export: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(__import__("sys").modules, "fiftyone", None)
        with pytest.raises(MissingPackageError, match="pip install 'fiftyone'"):
            to_fiftyone(touchline.open(export), tmp_path)

    def test_a_version_is_a_dataset_whose_slices_are_the_views(
        self, export: Path, tmp_path: Path, database: None
    ) -> None:
        version = touchline.open(export)
        found = to_fiftyone(version, tmp_path, "league-v1")
        assert (found.name, found.media_type, len(found)) == ("league-v1", "group", len(version))
        assert found.info == {"dataset": "league", "version": "v1", "hash": version.hash}
        seen = []
        for name in found.group_slices:
            found.group_slice = name
            seen += [(sample["key"], sample["view"]) for sample in found.iter_samples()]
        assert sorted(seen) == sorted((view.group, view.key) for view in version.views)


class TestToSamples:
    def test_views_of_one_moment_are_one_group_with_box_and_lines(
        self, export: Path, tmp_path: Path
    ) -> None:
        pytest.importorskip("fiftyone")
        version = touchline.open(export)
        found = to_samples(version, tmp_path)
        assert [sample["view"] for sample in found] == [view.key for view in version.views]
        moments = [sample["moment"].id for sample in found]
        assert len(set(moments)) == len(version)
        view, sample = version.views[0], found[0]
        assert Path(sample.filepath).read_bytes() == view.frame()
        assert sample.tags == [view.split]
        x, y, width, height = sample["ball"].bounding_box
        box = view.ball.box
        assert (x * view.width - 0.5, y * view.height - 0.5) == pytest.approx((box.x, box.y))
        assert (width * view.width, height * view.height) == pytest.approx((box.width, box.height))
        labels = {line.label for line in sample["lines"].polylines}
        assert labels == set(view.lines)


class TestPolylines:
    def test_a_marking_that_the_picture_does_not_show_is_no_polyline(self, export: Path) -> None:
        view = replace(
            touchline.open(export).views[0],
            lines_json='{"Middle line": [], "Side line top": [[1.0, 2.0]]}',
        )
        package = SimpleNamespace(Polyline=SimpleNamespace)
        assert [line.label for line in _polylines(package, view)] == ["Side line top"]


class TestWritten:
    def test_no_frame_is_written_outside_of_the_folder(self, export: Path, tmp_path: Path) -> None:
        view = replace(touchline.open(export).views[0], file_name="../outside.png")
        with pytest.raises(DataError, match="leads out of"):
            _written(tmp_path / "frames", view)

    def test_another_picture_in_its_place_is_named_and_kept(
        self, export: Path, tmp_path: Path
    ) -> None:
        (view, *_) = touchline.open(export).views
        path = _written(tmp_path, view)
        assert _written(tmp_path, view) == path and path.read_bytes() == view.frame()
        path.write_bytes(b"of another version")
        with pytest.raises(DataError, match="is another picture than the frame of this version"):
            _written(tmp_path, view)
        assert path.read_bytes() == b"of another version"
