"""A short film in an allowed folder, and what a server makes of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.videos import write_video
from tests.waiting import SECONDS

FRAMES = 60


@pytest.fixture
def film(app: Any, tmp_path: Path) -> Path:
    """A video of numbered frames in the folder ``films``, which the operator allows."""
    folder = tmp_path / "films"
    folder.mkdir()
    object.__setattr__(app.state.services.settings, "import_folders", [folder])
    return write_video(folder / "final.mp4", "mp4v", FRAMES)


@pytest.fixture
def finished(app: Any) -> Callable[[Any], Any]:
    """The job that an answer started, once it is over."""

    def wait(answer: Any) -> Any:
        assert answer.status_code == 202, answer.text
        return app.state.services.jobs.wait(answer.json()["id"], SECONDS)

    return wait
