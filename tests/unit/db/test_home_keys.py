from __future__ import annotations

from pathlib import Path

import pytest

from app.config import Settings
from app.db.home import WEBHOOKS, get_or_make_secret_key
from app.errors import DamagedError


class TestInstallationKey:
    def test_is_made_once(self, tmp_path: Path) -> None:
        settings = Settings(home=tmp_path)
        key = get_or_make_secret_key(settings, WEBHOOKS)
        assert len(key) == 32
        assert get_or_make_secret_key(settings, WEBHOOKS) == key

    @pytest.mark.parametrize("found", [b"", b"x" * 31, b"x" * 33])
    def test_a_file_that_is_no_key_is_refused(self, tmp_path: Path, found: bytes) -> None:
        (tmp_path / WEBHOOKS).write_bytes(found)
        with pytest.raises(DamagedError, match=f"{len(found)} bytes"):
            get_or_make_secret_key(Settings(home=tmp_path), WEBHOOKS)
