from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.config import Settings
from app.errors import InputError, NotFoundError, UnsafePathError
from app.features.imports.uploads import list_folder, map_import_folders_by_name, resolve_folder


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    data = tmp_path / "data"
    (data / "league" / "m").mkdir(parents=True)
    (data / "league" / "m" / "Labels-v3.json").write_text("{}")
    (data / "a.zip").write_bytes(b"PK")
    (data / ".hidden").write_text("x")
    (tmp_path / "secret").mkdir()
    (data / "out").symlink_to(tmp_path / "secret")
    other = tmp_path / "more" / "data"
    other.mkdir(parents=True)
    return Settings(home=tmp_path / "home", import_folders=[data, other])


class TestSetting:
    def test_folders_are_separated_like_a_path_or_a_json_list(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for text in (os.pathsep.join(["/a", "/b c"]), '["/a", "/b c"]'):
            monkeypatch.setenv("TOUCHLINE_IMPORT_FOLDERS", text)
            assert Settings().import_folders == [Path("/a"), Path("/b c")]
        monkeypatch.delenv("TOUCHLINE_IMPORT_FOLDERS")
        assert Settings().import_folders == []


class TestListFolder:
    def test_without_a_path_it_names_the_allowed_ones(self, settings: Settings) -> None:
        listing = list_folder(settings)
        assert [item.path for item in listing.items] == ["data", "data-2"]
        assert set(map_import_folders_by_name(settings)) == {"data", "data-2"}

    def test_folders_come_first_and_hidden_files_and_links_not_at_all(
        self, settings: Settings
    ) -> None:
        listing = list_folder(settings, "data")
        assert [(item.path, item.folder) for item in listing.items] == [
            ("data/league", True), ("data/a.zip", False),
        ]  # fmt: skip
        assert listing.format == "soccernet-v3"

    def test_a_file_is_listed_as_what_it_is(self, settings: Settings) -> None:
        listing = list_folder(settings, "data/league/m/Labels-v3.json")
        assert (listing.items, listing.format) == ((), "soccernet-v3")


class TestResolveFolder:
    @pytest.mark.parametrize(
        "path", ["data/../secret", "data/out", "../x", "data/%2e%2e/secret", "data\\..\\x", "/etc"]
    )
    def test_no_path_leads_out_of_the_allowed_folders(self, settings: Settings, path: str) -> None:
        with pytest.raises(UnsafePathError):
            resolve_folder(settings, path)

    @pytest.mark.parametrize("path", ["data/none", "etc", "home", "data/" + "x" * 300])
    def test_a_folder_that_is_not_there_is_not_found(self, settings: Settings, path: str) -> None:
        with pytest.raises(NotFoundError):
            resolve_folder(settings, path)

    def test_who_names_no_allowed_folder_is_told_which_there_are(self, settings: Settings) -> None:
        names = ", ".join(sorted(map_import_folders_by_name(settings)))
        with pytest.raises(NotFoundError) as caught:
            resolve_folder(settings, "imp/data")
        assert caught.value.hint == f"There are: {names}."

    def test_without_allowed_folders_it_says_who_names_them(self, tmp_path: Path) -> None:
        with pytest.raises(InputError) as caught:
            resolve_folder(Settings(home=tmp_path), "data")
        assert "TOUCHLINE_IMPORT_FOLDERS" in str(caught.value.hint)
