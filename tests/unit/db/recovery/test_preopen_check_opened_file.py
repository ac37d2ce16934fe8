from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from app.db.recovery.preopen_check import find_write_ahead_log_file
from app.db.store import Store
from app.errors import DamagedError
from tests.databases import Databases
from tests.unit.db.homes import INSERT, add, log_ids, names, say


def replace_file(file: Path, content: bytes) -> None:
    other = file.with_name("other")
    other.write_bytes(content)
    other.replace(file)


@pytest.mark.file_of_sqlite("the file that is open")
class TestAFileThatIsTakenAway:
    @pytest.mark.parametrize(
        ("take", "said"),
        [
            (lambda file: file.rename(file.with_name("aside.db")), "moved or deleted"),
            (lambda file: file.unlink(), "moved or deleted"),
            (lambda file: replace_file(file, b"another"), "replaced by another file"),
        ],
    )
    @pytest.mark.parametrize("lasting", [True, False])
    def test_no_change_is_taken_before_or_within_a_transaction(
        self, own_store: Store, take: Callable[[Path], None], said: str, lasting: bool
    ) -> None:
        add(own_store, "kept")
        with pytest.raises(DamagedError, match=said), own_store.write(lasting=lasting) as session:
            session.execute(text(INSERT.format("lost")))
            take(own_store.settings.database_file)
        with pytest.raises(DamagedError, match=f"nothing can be changed now: .* {said}") as caught:
            add(own_store, "late")
        assert "Stop the server and move the database file back" in str(caught.value.hint)
        assert names(own_store) == ["kept"]

    def test_it_is_seen_before_anything_is_asked_for(self, own_store: Store) -> None:
        own_store.require_undamaged()
        own_store.settings.database_file.unlink()
        with pytest.raises(DamagedError, match="moved or deleted"):
            own_store.require_undamaged()
        assert own_store.is_damaged

    def test_the_file_that_was_moved_has_all_that_was_saved_once_it_is_back(
        self, databases: Databases, tmp_path: Path
    ) -> None:
        own_store = Store.open(databases.settings(tmp_path / "home"))
        file = own_store.settings.database_file
        say(own_store, 3)
        backup = file.read_bytes()
        file.rename(tmp_path / "aside.db")
        replace_file(file, backup)
        with pytest.raises(DamagedError, match="replaced"):
            say(own_store)
        own_store.close()
        (tmp_path / "aside.db").replace(file)
        with closing(Store.open(own_store.settings)) as again:
            assert log_ids(again) == [1, 2, 3]

    def test_a_write_ahead_log_that_is_gone_is_seen_and_costs_nothing_that_was_saved(
        self, databases: Databases, tmp_path: Path
    ) -> None:
        own_store = Store.open(databases.settings(tmp_path / "home"))
        say(own_store, 3)
        find_write_ahead_log_file(own_store.settings.database_file).unlink()
        with pytest.raises(DamagedError, match=r"touchline\.db-wal was moved or deleted") as caught:
            say(own_store)
        assert "Stop the server before" in str(caught.value.hint)
        own_store.close()
        with closing(Store.open(own_store.settings)) as again:
            assert log_ids(again) == [1, 2, 3]
