"""The terminal: progress and complaints on stderr, results on stdout."""

from __future__ import annotations

import codecs
import io
import math
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from threading import Event
from typing import Any, TypeVar

from app.json_text import json_text, replace_non_finite
from app.progress import ReportProgress

Row = TypeVar("Row")

INTERRUPTED = 130
"""Exit code of what Ctrl+C ended, as shells have it."""
MAX_PROBLEMS = 10
"""Problems that are printed one by one."""
MAX_MISSING = 20
"""Missing images that are named in a table."""
# Steering characters of terminals (C0 and C1), and those that turn the direction of writing.
_STEERING = (*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
_SPELT = {code: f"\\u{code:04x}" for code in _STEERING if code not in (0x0A, 0x09)}
MIN_SECONDS = 0.1
"""A bar that moves more often costs more than it shows."""
LINE_SECONDS = 3.0
"""Where output is no terminal, a line of progress comes no more often."""


def escape_controls(text: str) -> str:
    """A text whose control characters are spelt out: a file's name must not steer a terminal.

    They are spelt as JSON spells them, so that a JSON document stays what it is. Line ends stay.
    """
    return text.translate(_SPELT)


@contextmanager
def show_progress(what: str) -> Iterator[ReportProgress]:
    """A bar on stderr while something runs; without a terminal, a line every few seconds."""
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TimeElapsedColumn(),
        rich.TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _print_progress_lines(what)
        return
    with rich.Progress(*columns, console=console) as bar:
        task = bar.add_task(what, total=None)
        last = 0.0

        # A bar has no room for sentences.
        def print_progress(done: int, total: int | None = None, _sentence: str = "") -> None:
            nonlocal last
            if done == total or time.monotonic() - last > MIN_SECONDS:
                last = time.monotonic()
                bar.update(task, completed=done, total=total)

        yield print_progress


def _print_progress_lines(what: str) -> ReportProgress:
    """Progress in plain lines; what is done within seconds tells none."""
    last = time.monotonic()

    def print_progress(done: int, total: int | None = None, sentence: str = "") -> None:
        nonlocal last
        if time.monotonic() - last < LINE_SECONDS:
            return
        last = time.monotonic()
        place = f"{done:,}" if total is None else f"{done:,} of {total:,}"
        stage = f"{sentence.rstrip('.')} ({place})" if sentence else place
        print_error(f"{what}: {stage}")

    return print_progress


@contextmanager
def hold_interrupts() -> Iterator[Callable[[], bool]]:
    """Ctrl+C as something that is asked for, so that what is done can be kept.

    Processes that are started meanwhile never hear of it.

    Yields:
        Whether somebody pressed it.
    """
    heard = Event()
    before = signal.signal(signal.SIGINT, lambda *_: heard.set())
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield lambda: heard.is_set() or signal.SIGINT in signal.sigpending()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, before)


def escape_unencodable_output() -> None:
    """Let no letter be too much for the terminal's encoding: it is spelt as JSON spells it."""
    codecs.register_error("spelt", _escape_unencodable)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="spelt")


def _escape_unencodable(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return json_text(text, ascii_=True)[1:-1], error.end


def print_error(message: str, hint: str | None = None) -> None:
    """One sentence on stderr, and what to do about it."""
    print(escape_controls(message), file=sys.stderr)  # noqa: T201
    if hint:
        print(escape_controls(hint), file=sys.stderr)  # noqa: T201


def print_problems(problems: Sequence[str]) -> None:
    """What could not be read, on stderr; ``--json`` has all of it."""
    for problem in problems[:MAX_PROBLEMS]:
        print_error(problem)
    if len(problems) > MAX_PROBLEMS:
        print_error(f"... and {len(problems) - MAX_PROBLEMS} more problems; --json names all")


def say(line: str) -> None:
    """A line of the result, at once."""
    print(escape_controls(line), flush=True)  # noqa: T201


def print_json(value: Any) -> None:
    """One JSON document on stdout."""
    say(json_text(value, indent=2))


def print_values(values: Mapping[str, Any], as_json: bool) -> None:
    """A result by name, as a table or as JSON."""
    if as_json:
        print_json(values)
        return
    width = max((len(name) for name in values), default=0)
    for name, value in values.items():
        say(f"{name.replace('_', ' '):{width}}  {_value_text(value)}")


def print_rows(
    rows: Iterable[Row], as_json: bool, values: Callable[[Row], Any], line: Callable[[Row], str]
) -> None:
    """Each of some things on a line of its own, or the values of all as one JSON list."""
    if as_json:
        print_json([values(row) for row in rows])
        return
    for row in rows:
        say(line(row))


def print_import(values: Mapping[str, Any], as_json: bool) -> None:
    """What an import did, and every problem that it met with its place."""
    if as_json:
        print_json(values)
        return
    skipped = values["skipped"]
    hidden = {"skipped", "remarks", "more_skipped"}
    shown = {name: value for name, value in values.items() if name not in hidden}
    print_values({**shown, "skipped": len(skipped) + values["more_skipped"]}, False)
    for problem in skipped:
        place = ", ".join(problem[part] for part in ("file", "record", "field") if problem[part])
        say(f"  {place}: {problem['problem']}")
    for remark in values["remarks"]:
        say(f"  {remark}")


def print_export(values: Mapping[str, Any], as_json: bool) -> None:
    """What an export wrote, and the names of the first frames that it could not have."""
    print_values(values, as_json)
    if as_json:
        return
    from app.formats.export_formats import describe_missing_content

    absent = describe_missing_content(values.get("format", ""), values["counts"])
    if absent is not None:
        say(f"Not complete: {absent}. --images copy puts them there.")
    missing = values["missing_images"]
    for line in missing[:MAX_MISSING]:
        say(f"  {line}")
    if len(missing) > MAX_MISSING:
        say(f"  and {len(missing) - MAX_MISSING} more; --json names them all")


def _value_text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_value_text(item)}" for name, item in value.items()) or "none"
    if isinstance(value, (list, tuple)):
        if value and all(isinstance(item, float) for item in value):
            return " ".join(map(_value_text, value))
        return str(len(value))
    return "none" if replace_non_finite(value) is None else str(value)
