"""The notice of maintenance: one for everybody, over when its time is."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from app.db.store import Store
from app.errors import InputError
from app.features.audit.queries import AuditQuery
from app.features.audit.service import read_audit
from app.features.maintenance.service import Banner, clear_banner, read_banner, set_banner
from app.features.people.visibility_queries import EVERYTHING

SOON = datetime.now(UTC) + timedelta(hours=1)


class TestSetBanner:
    def test_the_last_one_stands(self, store: Store) -> None:
        assert read_banner(store) is None
        set_banner(store, "Upgrade", actor="anna")
        set_banner(store, " Upgrade at 18:00 ", until=SOON, actor="anna")
        found = read_banner(store)
        assert found is not None
        assert (found.text, found.starts) == ("Upgrade at 18:00", None)
        assert found.until == SOON.isoformat(timespec="microseconds")

    def test_one_whose_time_is_over_is_none(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        set_banner(store, "Upgrade", until=SOON, actor="anna")
        later = (SOON + timedelta(seconds=1)).isoformat(timespec="microseconds")
        monkeypatch.setattr("app.features.maintenance.service.now", lambda: later)
        assert read_banner(store) is None

    def test_one_that_comes_is_told_with_its_time(self, store: Store) -> None:
        banner = set_banner(store, "Upgrade", starts=SOON, actor="anna")
        assert (
            read_banner(store)
            == banner
            == Banner("Upgrade", SOON.isoformat(timespec="microseconds"))
        )

    @pytest.mark.parametrize("text", ["", "  ", "x" * 301, "a\nb", "a\0b", "a\x1b[31m"])
    def test_it_is_one_short_line(self, store: Store, text: str) -> None:
        with pytest.raises(InputError, match=r"must (have 1 to 300 characters|be one line)"):
            set_banner(store, text, actor="anna")

    @pytest.mark.parametrize(
        ("starts", "until"),
        [
            (None, datetime(2020, 1, 1, tzinfo=UTC)),
            (SOON, SOON),
            (SOON, SOON - timedelta(minutes=1)),
        ],
    )
    def test_one_that_would_never_be_shown_is_refused(
        self, store: Store, starts: datetime | None, until: datetime
    ) -> None:
        with pytest.raises(InputError, match="never be shown"):
            set_banner(store, "Upgrade", starts=starts, until=until, actor="anna")

    def test_the_audit_knows_who_did_it(self, store: Store) -> None:
        set_banner(store, "Upgrade", actor="anna")
        clear_banner(store, actor="berta")
        clear_banner(store, actor="carl")
        rows = read_audit(store, AuditQuery(), EVERYTHING).items
        assert sorted(row.actor for row in rows) == ["anna", "berta"]
        assert read_banner(store) is None
