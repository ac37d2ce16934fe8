"""What every test process does, whatever it tests."""

from __future__ import annotations

import gc

YOUNG = 50_000
"""New objects before the collector looks at them: seventy times as many as by default."""


def pytest_collection_finish() -> None:
    """Leave modules and tests out of the search for garbage: they stay until the end."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(YOUNG)
