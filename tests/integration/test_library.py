"""The library against a real server: a version frozen, fetched, kept, and its frames."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import touchline as library
from touchline.errors import DataError, HashError, RequestError, StaleError, UnreachableError

ALIKE_PX = 1e-9


@pytest.fixture(scope="module")
def address(own_server: str) -> str:
    return own_server


@pytest.fixture(scope="module")
def connected(address: str) -> Iterator[library.Client]:
    """A client of the server."""
    with library.Client(address) as client:
        yield client


@pytest.fixture(scope="module")
def frozen(connected: library.Client) -> dict[str, Any]:
    """A version of what the policy passes."""
    request = {"name": "library", "groups": "passing"}
    connected.wait(connected.post("datasets/small/versions", request))
    found: dict[str, Any] = connected.get("datasets/small/versions")["items"][0]
    return found


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def version(address: str, frozen: dict[str, Any], cache: Path) -> library.Dataset:
    return library.open(address, "library", dataset="small", cache=cache)


class TestOpen:
    def test_the_version_is_the_one_that_the_server_names(
        self, version: library.Dataset, frozen: dict[str, Any]
    ) -> None:
        assert (version.name, version.version, version.hash) == (
            "small", "library", frozen["hash"],
        )  # fmt: skip
        assert len(version) == frozen["counts"]["groups"]
        assert sum(view.ball_3d is not None for view in version.views) == frozen["counts"]["balls"]

    def test_it_is_fetched_once_and_kept_under_its_hash(
        self, address: str, version: library.Dataset, frozen: dict[str, Any], cache: Path
    ) -> None:
        (kept,) = (cache / "versions").iterdir()
        assert kept.name.startswith(frozen["hash"])
        before = kept.stat().st_mtime_ns
        again = library.open(
            library.Client(address), frozen["hash"][:12], dataset="small", cache=cache
        )
        assert (again.groups, kept.stat().st_mtime_ns) == (version.groups, before)

    def test_nothing_is_left_on_the_server(
        self,
        connected: library.Client,
        version: library.Dataset,
        frozen: dict[str, Any],
    ) -> None:
        exports = list(connected.pages("exports", dataset="small"))
        ours = [item for item in exports if item["request"]["version"] == frozen["id"]]
        assert {item["status"] for item in ours} == {"gone"}

    def test_what_was_spoiled_in_the_cache_is_refused_with_what_to_do(
        self, address: str, version: library.Dataset, tmp_path: Path
    ) -> None:
        library.open(address, "library", dataset="small", cache=tmp_path)
        (kept,) = (tmp_path / "versions").iterdir()
        sound = kept.read_bytes()
        for place in (len(sound) // 2, len(sound) - 10):
            spoiled = bytearray(sound)
            spoiled[place] ^= 255
            kept.write_bytes(spoiled)
            with pytest.raises(HashError, match=f"Delete {kept} and open the version again"):
                library.open(address, "library", dataset="small", cache=tmp_path)

    def test_another_version_under_its_name_in_the_cache_is_refused(
        self, address: str, frozen: dict[str, Any], cache: Path, tmp_path: Path
    ) -> None:
        library.open(address, "library", dataset="small", cache=cache)
        (kept,) = (cache / "versions").iterdir()
        stranger = {**frozen, "hash": "f" * 64}
        target = tmp_path / "versions" / kept.name.replace(frozen["hash"], stranger["hash"])
        target.parent.mkdir()
        target.write_bytes(kept.read_bytes())
        with pytest.raises(HashError, match=f"Delete {target} and open the version again"):
            library.open(_Naming(stranger), "library", dataset="small", cache=tmp_path)

    def test_what_is_not_there_is_told_with_what_is(self, address: str, cache: Path) -> None:
        with pytest.raises(DataError, match="There are: library"):
            library.open(address, "v99", dataset="small", cache=cache)
        with pytest.raises(DataError, match="has no frozen version"):
            library.open(address, dataset="spoiled", cache=cache)
        with pytest.raises(DataError, match="Say which: dataset= one of"):
            library.open(address, cache=cache)


class _Naming:
    """A server that names another version than it has; everything else is asked of no server."""

    def __init__(self, version: dict[str, Any]):
        self._version = version

    def get(self, _path: str) -> dict[str, Any]:
        return {"items": [self._version]}


class TestNumbers:
    def test_points_and_balls_are_where_the_server_draws_them(
        self, connected: library.Client, version: library.Dataset
    ) -> None:
        rows = {row["key"]: row["id"] for row in connected.pages("groups", dataset="small")}
        compared = 0
        for group in version:
            document = connected.get(f"groups/{rows[group.key]}")
            for view in document["solution"]["views"]:
                mine = next(item for item in group.views if item.key == view["view"])
                if view["ball"] is None or mine.ball is None or mine.ball_3d is None:
                    continue
                assert mine.camera is not None
                seen = mine.camera.project(mine.ball_3d.position)
                assert np.abs(seen - view["ball"]["reprojected"]).max() < ALIKE_PX
                compared += 1
        assert compared >= 8


class TestFrames:
    def test_they_come_from_the_server_or_along_with_the_version(
        self, address: str, version: library.Dataset, cache: Path
    ) -> None:
        view = version.views[0]
        image = view.image()
        assert image.shape == (view.height, view.width, 3)
        whole = library.open(address, "library", dataset="small", cache=cache, images=True)
        assert len([*(cache / "versions").iterdir()]) == 2
        assert (whole.views[0].image() == image).all()
        assert whole.views[0].frame() == view.frame()

    def test_a_worker_process_makes_its_own_connection(self, version: library.Dataset) -> None:
        samples = version.samples()
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            (again,) = pool.map(samples.__getitem__, [0])
        assert (again["image"] == samples[0]["image"]).all()


class TestClient:
    def test_an_edit_says_what_it_builds_on_and_who_is_late_is_told(
        self, connected: library.Client
    ) -> None:
        row = next(connected.pages("groups", dataset="small"))
        group = connected.get(f"groups/{row['id']}")
        view = group["views"][0]
        path = f"views/{view['id']}/ball"
        edited = connected.patch(path, None, if_match=group)
        assert edited["views"][0]["balls"] == []
        with pytest.raises(StaleError) as caught:
            connected.patch(path, None, if_match=group)
        assert caught.value.current["etag"] == edited["etag"]
        undone = connected.post(f"groups/{row['id']}/undo", if_match=edited)
        assert undone["views"][0]["balls"] == view["balls"]

    def test_a_wrong_request_says_where(self, connected: library.Client) -> None:
        with pytest.raises(RequestError) as caught:
            connected.post("exports", {"dataset": "small", "format": "parquett"})
        assert caught.value.pointer == "/format"
        with pytest.raises(RequestError):
            connected.get("groups", dataset="small", q="jac<low")

    def test_every_page_is_read(self, connected: library.Client) -> None:
        keys = [row["key"] for row in connected.pages("groups", dataset="small", limit=1)]
        assert len(keys) == len(set(keys)) == 4

    def test_nobody_there_is_said_so(self, tmp_path: Path) -> None:
        with pytest.raises(UnreachableError):
            library.Client("http://127.0.0.1:9", patience=0).get("datasets")
