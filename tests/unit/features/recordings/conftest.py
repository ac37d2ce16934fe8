"""A recording of a short film."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def recording(api: Any, film: Path, finished: Callable[[Any], Any]) -> str:
    """The address of the film, brought into the dataset *cup* and indexed."""
    body = {"dataset": "cup", "source": {"folder": "films/final.mp4"}}
    job = finished(api.post("/api/v1/recordings", json=body))
    assert job.state == "done", job.problem
    return f"/api/v1/recordings/{job.result['recording']}"
