"""The log: lines that people read, or objects that collectors read."""

from __future__ import annotations

import json
import subprocess
import sys

PROGRAM = """
import logging, structlog
from app.log import log_to_stderr
log_to_stderr({form!r})
with structlog.contextvars.bound_contextvars(request="abc"):
    structlog.get_logger("touchline").info("request answered", milliseconds=1.5, ratio=float("nan"))
try:
    1 / 0
except ZeroDivisionError:
    logging.getLogger("uvicorn.error").exception("it failed\\nin two lines")
"""


def logged(form: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(form=form)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == ""
    return done.stderr.splitlines()


class TestLogToStderr:
    def test_text_is_a_line_of_names_and_values(self) -> None:
        line = logged("text")[0]
        assert line.startswith("timestamp=")
        assert "event='request answered' milliseconds=1.5 ratio=None request='abc'" in line

    def test_json_is_an_object_a_line_also_of_what_libraries_log(self) -> None:
        ours, theirs = map(json.loads, logged("json"))
        assert (ours["event"], ours["request"], ours["milliseconds"]) == (
            "request answered",
            "abc",
            1.5,
        )
        assert (ours["ratio"], ours["level"]) == (None, "info")
        assert (theirs["event"], theirs["logger"]) == ("it failed\nin two lines", "uvicorn.error")
        assert "ZeroDivisionError" in theirs["exception"]
        assert theirs["level"] == "error"
