from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from app.errors import DamagedError
from app.store.recovery.preopen_check import log_file
from app.store.store import Store
from tests.databases import Databases
from tests.unit.store.homes import INSERT, add, log_ids, names, say


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
        self, store: Store, take: Callable[[Path], None], said: str, lasting: bool
    ) -> None:
        add(store, "kept")
        with pytest.raises(DamagedError, match=said), store.write(lasting=lasting) as session:
            session.execute(text(INSERT.format("lost")))
            take(store.settings.database_file)
        with pytest.raises(DamagedError, match=f"nothing can be changed now: .* {said}") as caught:
            add(store, "late")
        assert "Stop the server and put the file that was moved back" in str(caught.value.hint)
        assert names(store) == ["kept"]

    def test_it_is_seen_before_anything_is_asked_for(self, store: Store) -> None:
        store.require_undamaged()
        store.settings.database_file.unlink()
        with pytest.raises(DamagedError, match="moved or deleted"):
            store.require_undamaged()
        assert store.is_damaged

    def test_the_file_that_was_moved_has_all_that_was_saved_once_it_is_back(
        self, databases: Databases, tmp_path: Path
    ) -> None:
        store = Store.open(databases.settings(tmp_path / "home"))
        file = store.settings.database_file
        say(store, 3)
        backup = file.read_bytes()
        file.rename(tmp_path / "aside.db")
        replace_file(file, backup)
        with pytest.raises(DamagedError, match="replaced"):
            say(store)
        store.close()
        (tmp_path / "aside.db").replace(file)
        with closing(Store.open(store.settings)) as again:
            assert log_ids(again) == [1, 2, 3]

    def test_a_write_ahead_log_that_is_gone_is_seen_and_costs_nothing_that_was_saved(
        self, databases: Databases, tmp_path: Path
    ) -> None:
        store = Store.open(databases.settings(tmp_path / "home"))
        say(store, 3)
        log_file(store.settings.database_file).unlink()
        with pytest.raises(DamagedError, match=r"touchline\.db-wal was moved or deleted") as caught:
            say(store)
        assert "Stop the server before" in str(caught.value.hint)
        store.close()
        with closing(Store.open(store.settings)) as again:
            assert log_ids(again) == [1, 2, 3]
