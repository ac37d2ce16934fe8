"""Paths of a home that was moved: its own files are found, and nobody else's."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.db.home_paths import find_path_in_home

UPLOAD = f"uploads/{'a' * 32}/content/film.mp4"
FRAME = f"recordings/{'b' * 64}/5.png"
PRACTICE = "practice/league/5.png"


@pytest.fixture
def home(tmp_path: Path) -> Path:
    for name in (UPLOAD, FRAME, PRACTICE):
        file = tmp_path / "home" / name
        file.parent.mkdir(parents=True)
        file.touch()
    return tmp_path / "home"


@pytest.mark.parametrize("name", [UPLOAD, FRAME, PRACTICE])
def test_a_file_of_the_former_home_is_found_in_this_one(home: Path, name: str) -> None:
    assert find_path_in_home(f"/gone/home/{name}", home) == str(home / name)
    assert find_path_in_home(str(home / name), home) == str(home / name)


def test_beside_the_former_home_this_one_has_its_own_uploads_and_frames(
    home: Path, tmp_path: Path
) -> None:
    home.rename(tmp_path / "new")
    for name in (UPLOAD, FRAME, PRACTICE):
        (home / name).parent.mkdir(parents=True)
        (home / name).touch()
    found = [find_path_in_home(str(home / name), tmp_path / "new") for name in (UPLOAD, FRAME)]
    assert found == [str(tmp_path / "new" / name) for name in (UPLOAD, FRAME)]
    # It may be a folder of somebody else's.
    assert find_path_in_home(str(home / PRACTICE), tmp_path / "new") == str(home / PRACTICE)


@pytest.mark.parametrize(
    "path",
    [
        "/data/league/5.png",
        f"/gone/uploads/{'c' * 32}/content/film.mp4",
        f"/gone/uploads/short/{Path(UPLOAD).name}",
        f"s3://store/{UPLOAD}",
    ],
)
def test_other_paths_stay(home: Path, path: str) -> None:
    assert find_path_in_home(path, home) == path


def test_a_lost_upload_is_never_another_file_of_a_similar_name(home: Path) -> None:
    (home / "sample").mkdir(parents=True, exist_ok=True)
    (home / "sample" / "a.png").write_bytes(b"another")
    lost = f"/former/uploads/{'0' * 32}/sample/a.png"
    assert find_path_in_home(lost, home) == lost


def test_no_path_leads_out_of_the_home(home: Path) -> None:
    path = f"/former/uploads/{'0' * 32}/../../sample/a.png"
    assert find_path_in_home(path, home) == path
