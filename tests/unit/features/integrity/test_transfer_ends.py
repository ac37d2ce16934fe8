"""Ends of a transfer: a home, an address, or a file that holds one."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.config import Settings
from app.errors import InputError
from app.features.integrity.transfer import make_settings_of_both_databases, transfer_database

ADDRESS = "postgresql://ann:secret@db/touchline"


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "own")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with an address that its owner alone may read."""
    file = tmp_path / "address"
    file.write_text(f"{ADDRESS}\n")
    file.chmod(0o600)
    return file


def test_a_home_that_goes_into_a_database_keeps_its_files(
    settings: Settings, file: Path, tmp_path: Path
) -> None:
    begin, end = make_settings_of_both_databases(str(tmp_path / "home"), str(file), settings)
    assert (begin.home, begin.database_url) == (tmp_path / "home", None)
    assert (end.home, end.database_url) == (tmp_path / "home", ADDRESS)


def test_a_database_that_goes_into_a_home_makes_a_new_home(
    settings: Settings, tmp_path: Path
) -> None:
    begin, end = make_settings_of_both_databases(
        "postgresql://db/touchline", str(tmp_path / "new"), settings
    )
    assert begin.database_url == "postgresql://db/touchline"
    assert (end.home, end.database_url) == (tmp_path / "new", None)


def test_a_home_without_a_database_is_refused_and_not_made(
    settings: Settings, tmp_path: Path
) -> None:
    ends = make_settings_of_both_databases(str(tmp_path / "hoem"), str(tmp_path / "new"), settings)
    with pytest.raises(InputError, match=r"there is no database in .*hoem"):
        transfer_database(*ends)
    assert not (tmp_path / "hoem").exists() and not (tmp_path / "new").exists()


@pytest.mark.parametrize("address", [ADDRESS, "postgresql://db/touchline?user=ann&password=secret"])
def test_a_password_that_everybody_could_read_is_refused(settings: Settings, address: str) -> None:
    with pytest.raises(InputError, match="can read the password in FROM"):
        make_settings_of_both_databases(address, "home", settings)
    with pytest.raises(InputError, match="can read the password in TO"):
        make_settings_of_both_databases("home", address, settings)


def test_a_file_that_others_may_read_is_refused(settings: Settings, file: Path) -> None:
    file.chmod(0o640)
    with pytest.raises(InputError, match="other users can read"):
        make_settings_of_both_databases(str(file), "home", settings)


def test_a_file_without_an_address_is_refused(settings: Settings, file: Path) -> None:
    file.write_text("db/touchline")
    with pytest.raises(InputError, match="contains no address of a database"):
        make_settings_of_both_databases("home", str(file), settings)
