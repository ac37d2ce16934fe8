"""A restored home reads its own films, frames and cameras, wherever it lies."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.config import Settings
from app.db.backup import FRAMES, back_up_home
from app.db.restore import restore_database
from app.features.groups.replay import rebuild_tables
from app.features.imports.ingest import import_groups
from app.features.integrity.checks import examine_everything
from app.features.recordings.camera_tracking import TrackedStretch, save_cameras
from app.features.recordings.service import get_recording
from app.features.solutions.service import solve_dataset
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.verify import verify_version
from app.http.deps import Services
from app.soccer.group import Group, Media
from app.tracking.track import FrameCamera
from tests.cameras import SIZE, looking
from tests.waiting import SECONDS

pytestmark = pytest.mark.file_of_sqlite("a home that is copied and restored")

BYTES = {"Content-Type": "application/octet-stream"}
CAMERA = looking((5.0, 62.0, -18.0), (8.0, 0.0, 0.0), 1500.0)
Finished = Callable[[Any], Any]


def frame_camera(number: int) -> FrameCamera:
    sigma = tuple(np.diag(np.full(8, 0.01)).ravel().tolist())
    return FrameCamera(
        number, number / 25, "tracked", SIZE, CAMERA, sigma, 0.9, 0.7, 0.1, number == 0, None
    )


@pytest.fixture
def home(app: Any, api: Any, film: Path, group: Group, finished: Finished) -> Path:
    """A home with an uploaded recording, cameras of it, a group of its frame 5, and a frozen version with this frame."""
    services = app.state.services
    sent = api.post("/api/v1/uploads?name=final.mp4", content=film.read_bytes(), headers=BYTES)
    source = {"dataset": "cup", "source": {"upload": sent.json()["id"]}}
    assert finished(api.post("/api/v1/recordings", json=source)).state == "done"
    frames = {"frames": [5], "propose": False}
    assert finished(api.post("/api/v1/recordings/1/groups", json=frames)).state == "done"
    recording = get_recording(services.store, 1)
    tracked = TrackedStretch([frame_camera(number) for number in range(10)], ())
    save_cameras(services.store, recording, (0, 9), tracked, [], "ann")
    shown = Media(str(next(services.settings.recordings.glob("*/5.png"))))
    views = tuple(replace(view, media=shown) for view in group.views)
    import_groups(services.store, "old", [replace(group, views=views)], source="test", actor="ann")
    solve_dataset(services.store, "old")
    freeze_dataset(services.store, "old", FreezeRequest("v1", groups="passing"), actor="ann")
    services.close()
    return Path(services.settings.home)


def serve(app: Any, home: Path) -> None:
    opened = Services.open(Settings(home=home))
    opened.frames.warm = lambda: None  # type: ignore[method-assign]
    app.state.services = opened


def find_faults(home: Path) -> dict[str, str]:
    return {
        check.name: check.sentence
        for check in examine_everything(Settings(home=home))
        if not check.ok
    }


def advice_on(home: Path, name: str) -> str:
    (found,) = [one for one in examine_everything(Settings(home=home)) if one.name == name]
    return found.advice or ""


def require_all_is_served(api: Any) -> None:
    recording = api.get("/api/v1/recordings/1").json()
    assert recording["problem"] is None
    assert api.get("/api/v1/recordings/1/frames/7").status_code == 200
    assert api.get("/api/v1/recordings/1/cameras/0").status_code == 200
    (group,) = api.get("/api/v1/groups?dataset=cup").json()["items"]
    (view,) = api.get(f"/api/v1/groups/{group['id']}").json()["views"]
    assert api.get(f"/api/v1/views/{view['id']}/image").status_code == 200


def test_a_backup_with_frames_is_whole_in_another_folder(
    app: Any, api: Any, home: Path, tmp_path: Path
) -> None:
    back_up_home(Settings(home=home), tmp_path / "b.zip", FRAMES)
    other = tmp_path / "new"
    restore_database(Settings(home=other), tmp_path / "b.zip")
    home.rename(tmp_path / "away")
    assert find_faults(other) == {}
    assert advice_on(other, "uploads") == advice_on(other, "recordings") == ""
    serve(app, other)
    require_all_is_served(api)
    store = app.state.services.store
    assert rebuild_tables(store) == []
    require_all_is_served(api)
    assert verify_version(store, 1).ok
    wanted = {"dataset": "old", "version": "v1", "format": "soccernet-v3", "images": "copy"}
    out = api.post("/api/v1/exports", json=wanted)
    assert out.status_code == 202, out.text
    done = app.state.services.jobs.wait(out.json()["id"], SECONDS)
    assert (done.state, done.problem) == ("done", None)
    app.state.services.close()
    # What the restored home has of its own is what the next backup takes.
    assert back_up_home(Settings(home=other), tmp_path / "c.zip", FRAMES).frames_elsewhere == 0


def test_a_home_that_was_moved_reads_its_own_files(
    app: Any, api: Any, home: Path, tmp_path: Path
) -> None:
    home.rename(tmp_path / "elsewhere")
    serve(app, tmp_path / "elsewhere")
    require_all_is_served(api)


def test_beside_the_old_home_it_reads_its_own_files(
    app: Any, api: Any, home: Path, tmp_path: Path
) -> None:
    shutil.copytree(home, tmp_path / "copy")
    serve(app, tmp_path / "copy")
    path = get_recording(app.state.services.store, 1).path
    assert path.is_relative_to(tmp_path / "copy")


def test_the_ordinary_backup_has_indices_and_cameras_and_says_which_frames_are_missing(
    app: Any, api: Any, home: Path, tmp_path: Path
) -> None:
    back_up_home(Settings(home=home), tmp_path / "b.zip")
    other = tmp_path / "new"
    restore_database(Settings(home=other), tmp_path / "b.zip")
    assert find_faults(other) == {}
    home.rename(tmp_path / "away")
    found = find_faults(other)
    assert found.keys() == {"recordings"}
    assert found["recordings"].startswith("1 file of recordings missing: ")
    assert found["recordings"].endswith("/5.png")
    shutil.copytree(tmp_path / "away" / "uploads", other / "uploads")
    serve(app, other)
    assert api.get("/api/v1/recordings/1").json()["problem"] is None
    assert api.get("/api/v1/recordings/1/cameras/0").status_code == 200


def test_restored_in_its_own_home_it_leaves_frames_in_their_place(
    app: Any, api: Any, home: Path, tmp_path: Path
) -> None:
    back_up_home(Settings(home=home), tmp_path / "b.zip")
    cameras = next((home / "recordings").glob("*.cameras.npz"))
    cameras.unlink()
    assert "recordings" in find_faults(home)
    restored = restore_database(Settings(home=home), tmp_path / "b.zip")
    assert restored.aside is not None
    assert (restored.aside / "recordings").is_dir()
    serve(app, home)
    require_all_is_served(api)


def test_nothing_is_to_be_deleted_while_a_file_is_missing(
    app: Any, home: Path, tmp_path: Path
) -> None:
    (home / "recordings" / "unknown").mkdir()
    assert "unknown" in advice_on(home, "recordings")
    next((home / "uploads").glob("*/content/final.mp4")).unlink()
    assert advice_on(home, "recordings").startswith("Delete nothing: ")


def test_an_index_that_is_gone_is_the_problem_of_its_recording(
    app: Any, api: Any, home: Path, finished: Finished
) -> None:
    index = next(path for path in (home / "recordings").glob("*.npz") if "." not in path.stem)
    index.unlink()
    serve(app, home)
    assert api.get("/api/v1/recordings/1").json()["problem"] == "the index of final.mp4 is missing"
    answer = api.get("/api/v1/recordings/1/frames/7")
    assert (answer.status_code, answer.json()["hint"]) == (409, "Index it again.")
    finished(api.post("/api/v1/recordings/1/shots"))
    require_all_is_served(api)


def test_a_film_that_was_copied_without_its_time_is_compared_once(
    app: Any, api: Any, home: Path, finished: Finished
) -> None:
    film = next((home / "uploads").glob("*/content/final.mp4"))
    index = next(path for path in (home / "recordings").glob("*.npz") if "." not in path.stem)
    written = index.stat().st_mtime_ns
    shutil.copyfile(film, film.with_name("copy"))
    film.with_name("copy").replace(film)
    serve(app, home)
    assert "has changed" in api.get("/api/v1/recordings/1").json()["problem"]
    assert finished(api.post("/api/v1/recordings/1/shots")).state == "done"
    require_all_is_served(api)
    assert index.stat().st_mtime_ns == written
