from __future__ import annotations

import pytest

from app.errors import StorageError
from app.store.locks import server_lock


class TestServerLock:
    def test_a_home_has_one_server(self, settings) -> None:
        refused = pytest.raises(StorageError, match="another Touchline server")
        with server_lock(settings), refused, server_lock(settings):
            pass
        with server_lock(settings):
            pass
