"""Carry, parsed: lines that another installation wrote, looked at before anything is believed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import IO, Any

from app.db.json_columns import Json
from app.errors import DatasetFormatError, InputError, ReviewError
from app.features.findings.queries import MERGED_COLUMNS
from app.features.groups.revision_chain import format_pitch_size, parse_logged_group
from app.features.imports.body import MAX_POINTS, MAX_VIEWS, count_points
from app.features.imports.edits_export import EDIT_KINDS, FORMAT, FORMAT_VERSION, HEAD
from app.features.imports.queries import VERDICT
from app.features.policies.service import CUSTOM, policy_to_values, replace_thresholds
from app.features.verdicts.service import STATES
from app.formats.file_tree import BROKEN, FileTree
from app.formats.json_reader import read_json
from app.formats.report import ReaderReport
from app.json_text import json_text, quote_text
from app.soccer.annotation import Extras
from app.soccer.codec import extras_from_json, policy_from_json, station_from_json
from app.soccer.finding import FINDING_KINDS
from app.soccer.frames import MAX_SIDE
from app.soccer.group import (
    CALIBRATIONS,
    MAX_NOTE,
    REASONS,
    Group,
    Station,
    View,
    make_view_exclusion,
)
from app.soccer.pitch import canonical_marking
from app.soccer.policy import PAPER, Policy

MAX_LINE = 32 * 1024 * 1024
MAX_BALLS, MAX_TEXT = 100, 1000
MAX_STATES = 100_000
_MISSHAPEN = (ArithmeticError, AttributeError, LookupError, ReviewError, TypeError, ValueError)
"""What reading a value raises that is not of the shape that it should have."""


@dataclass(frozen=True)
class MergeHeader:
    """The header of the file."""

    dataset: str
    policy: Policy


@dataclass(frozen=True)
class MergeStation:
    """A static camera: as it is there, as its dataset brought it, and its past."""

    station: Station
    base: Station
    states: tuple[str, ...]
    log: tuple[Json, ...]


@dataclass(frozen=True)
class MergeGroup:
    """A group: as it is there, as its dataset brought it, its past, and what people decided."""

    group: Group
    base: Group
    views: Mapping[str, tuple[str, ...]]
    stations: Mapping[str, tuple[str, ...]]
    pitches: tuple[str, ...]
    log: tuple[Json, ...]
    verdicts: tuple[Mapping[str, Any], ...]
    dismissals: tuple[Mapping[str, Any], ...] = ()


def read_merge_header(tree: FileTree) -> MergeHeader:
    """The header of the file.

    Raises:
        DatasetFormatError: It is no export of Touchline, or one of a newer kind.
    """
    shown = tree.shown(HEAD)
    if HEAD not in tree.names():
        raise DatasetFormatError(
            shown, None, None, "is missing; this is not an export in the format touchline"
        )
    value = read_json(tree.read_bytes(HEAD), shown)
    if not isinstance(value, dict) or value.get("format") != FORMAT:
        raise DatasetFormatError(shown, None, "format", f'is not "{FORMAT}"')
    if value.get("version") != FORMAT_VERSION:
        problem = f"is {value.get('version')}; this version of Touchline reads {FORMAT_VERSION}"
        raise DatasetFormatError(shown, None, "version", problem)
    try:
        policy = policy_from_json(_require_object(value["policy"]))
        # Its values reach the solver: a text in place of a number would break there.
        replace_thresholds(PAPER, policy_to_values(policy), name=CUSTOM)
        _require_text(policy.name)
        return MergeHeader(_require_text(value["dataset"]), policy)
    except InputError as error:
        raise DatasetFormatError(shown, None, "policy", f"is not a policy: {error}") from error
    except _MISSHAPEN as error:
        raise DatasetFormatError(shown, None, "policy", "is not a policy") from error


def read_lines(tree: FileTree, name: str, report: ReaderReport) -> Iterator[tuple[str, Json]]:
    """The records of a file of lines with their places; a broken line is skipped and told."""
    if name not in tree.names():
        return
    with tree.open(name) as file:
        for number, line in enumerate(_read_file_lines(file, tree.shown(name)), 1):
            report.read += 1
            try:
                yield f"line {number}", read_json(line, tree.shown(name), record=f"line {number}")
            except DatasetFormatError as error:
                report.add_problem(error)


def _read_file_lines(file: IO[bytes], shown: str) -> Iterator[bytes]:
    while line := _read_file_line(file, shown):
        if len(line) > MAX_LINE:
            raise DatasetFormatError(shown, None, None, f"has a line above {MAX_LINE:,} bytes")
        yield line


def _read_file_line(file: IO[bytes], shown: str) -> bytes:
    try:
        return file.readline(MAX_LINE + 1)
    except BROKEN as error:
        problem = "is damaged, here or in its zip file"
        raise DatasetFormatError(shown, None, None, problem) from error


def parse_station(value: Json) -> MergeStation:
    """A static camera of its line.

    Raises:
        InputError: It is not what Touchline writes.
    """
    try:
        station = _parse_station_record(_require_object(value)["station"])
        base = station if value["base"] is None else _parse_station_record(value["base"])
        if not (station.shared and base.shared and station.key == base.key):
            raise InputError("has a `base` that is not the same static camera as its `station`")
        return MergeStation(
            station, base, _require_digests(value["states"]), _parse_log_record(value["log"])
        )
    except _MISSHAPEN as error:
        raise _make_record_error(error) from error


def parse_group(value: Json, shared: Mapping[str, Station]) -> MergeGroup:
    """A group of its line.

    Raises:
        InputError: It is not what Touchline writes.
    """
    try:
        group = _parse_group_record(_require_object(value)["group"], shared)
        base = group if value["base"] is None else _parse_group_record(value["base"], shared)
        if group.key != base.key:
            raise InputError(
                f"has a `base` ({base.key}) that is not the same group as its `group` ({group.key})"
            )
        return MergeGroup(
            group=group,
            base=base,
            views={
                key: _require_digests(item) for key, item in _require_object(value["views"]).items()
            },
            stations={
                key: _require_digests(item)
                for key, item in _require_object(value["stations"]).items()
            },
            pitches=_parse_pitch_sizes(value, group, base),
            log=_parse_log_record(value["log"]),
            verdicts=tuple(
                map(_parse_verdict_record, _require_list(value["verdicts"], MAX_STATES))
            ),
            dismissals=tuple(
                map(_parse_dismissal_record, _require_list(value.get("dismissals", []), MAX_STATES))
            ),
        )
    except _MISSHAPEN as error:
        raise _make_record_error(error) from error


def parse_unassigned_frame(value: Json) -> tuple[str, str, Extras]:
    """Camera, frame and extras of a line.

    Raises:
        InputError: It is not what Touchline writes.
    """
    try:
        extras = _require_object(value)["extras"]
        return (
            _require_text(value["camera"]),
            _require_text(value["frame"]),
            _parse_extras_record(extras),
        )
    except _MISSHAPEN as error:
        raise _make_record_error(error) from error


def _make_record_error(error: Exception) -> InputError:
    if isinstance(error, ReviewError):
        return InputError(error.message)
    what = f"lacks {error}" if isinstance(error, KeyError) else "is not what Touchline writes"
    return InputError(what)


def _parse_group_record(value: Json, shared: Mapping[str, Station]) -> Group:
    views = _require_list(_require_object(value)["views"], MAX_VIEWS)
    names = {view["station"] for view in views if isinstance(view["station"], str)}
    if names - shared.keys():
        raise InputError(
            f'uses the static camera "{min(names - shared.keys())}", which the file does not have'
        )
    group = parse_logged_group(
        {**value, "views": [{**view, "media": None} for view in views]}, shared
    )
    keys = [_require_text(view.key) for view in group.views]
    if not keys or len(set(keys)) < len(keys):
        raise InputError("has no views, or two views of the same name")
    for text in (group.key, group.match, group.split, group.label):
        _require_text(text, empty=text is not group.key)
    if not (0 < group.pitch.length < 1000 and 0 < group.pitch.width < 1000):
        raise InputError("has a pitch whose length or width is not between 0 and 1000 m")
    for view, fields in zip(group.views, views, strict=True):
        _require_list(fields["balls"], MAX_BALLS)
        _parse_extras_record(fields["extras"])
        if view.included not in (True, False):
            raise InputError("has a view whose `included` is not true or false")
        if view.left_out is not None:
            _require_known_exclusion_reason(view)
        if not isinstance(fields["station"], str) and _validate_station(view.station).shared:
            raise InputError(
                f"contains the whole static camera {view.station.key} inside a view, which must"
                " contain only its key"
            )
    return group


def _require_known_exclusion_reason(view: View) -> None:
    why = view.left_out
    if (
        view.included
        or why is None
        or make_view_exclusion(_require_text(why.reason), why.note) != why
    ):
        raise InputError("has a view that was left out for a reason that Touchline does not know")


def _parse_station_record(value: Json) -> Station:
    return _validate_station(station_from_json(_require_object(value)))


def _validate_station(station: Station) -> Station:
    _require_text(station.key)
    for side in (station.size.width, station.size.height):
        if not isinstance(side, int) or isinstance(side, bool) or not 2 <= side <= MAX_SIDE:
            raise InputError(
                f"has an image width or height of {side}; both must be whole numbers from 2 to"
                f" {MAX_SIDE:,}"
            )
    if station.calibration not in CALIBRATIONS:
        raise InputError(
            f"has an unknown `calibration`; it must be one of {', '.join(CALIBRATIONS)}"
        )
    _require_booleans(
        "a static camera whose `flipped` or `shared`", station.flipped, station.shared
    )
    for marking in station.lines_with_not_visible:
        if canonical_marking(marking) != marking:
            raise InputError(f"has spaces around the name of the marking {quote_text(marking)}")
    if (count := count_points(station.lines)) > MAX_POINTS:
        raise InputError(
            f"has {count:,} points in the lines of {station.key}; the limit is {MAX_POINTS:,}"
        )
    if [*station.proposed] != [name for name in station.lines if name in station.proposed]:
        raise InputError("names lines as proposed that the view does not have")
    return station


def _require_booleans(what: str, *values: object) -> None:
    if not all(isinstance(value, bool) for value in values):
        raise InputError(f"has {what} is not true or false")


def _parse_verdict_record(value: Json) -> Mapping[str, Any]:
    values = {name: _require_object(value)[name] for name in VERDICT}
    for name in ("actor", "at", "inputs_hash", "policy_hash"):
        _require_text(values[name])
    for name in ("reason", "note", "override"):
        if values[name] is not None:
            _require_text(values[name], most=MAX_NOTE)
    if values["state"] not in STATES or values["fixed"] not in (True, False):
        raise InputError("has a verdict that Touchline does not know")
    if (values["state"] == "rejected") != (values["reason"] in REASONS):
        raise InputError("has a rejection without a reason, or a reason without a rejection")
    return values


def _parse_dismissal_record(value: Json) -> Mapping[str, Any]:
    values = {name: _require_object(value)[name] for name in MERGED_COLUMNS}
    for name in ("actor", "at", "sentence"):
        _require_text(values[name], most=MAX_NOTE)
    for name in ("view", "marking", "suggested", "note"):
        if values[name] is not None:
            _require_text(values[name], most=MAX_NOTE)
    number = values["number"]
    if number is not None and (type(number) not in (int, float) or not math.isfinite(number)):
        raise InputError(
            "has a dismissed finding whose `number` is neither null nor a finite number"
        )
    if values["kind"] not in FINDING_KINDS or values["dismissed"] not in (True, False):
        raise InputError("has a dismissed finding that Touchline does not know")
    return values


def _parse_log_record(value: Json) -> tuple[Json, ...]:
    for entry in _require_list(value, MAX_STATES):
        if entry["kind"] not in EDIT_KINDS:
            raise InputError("has a log entry of an unknown kind")
        _require_text(entry["actor"])
        _require_text(entry["at"])
        _require_object(entry["edit"])
    return tuple(value)


def _parse_extras_record(value: Json) -> Extras:
    if value is None:
        return Extras()
    for name in ("boxes", "lines"):
        for item in _require_list(_require_object(value)[name], MAX_STATES):
            _require_object(item)
    _require_object(value["metadata"])
    return extras_from_json(value)


def _parse_pitch_sizes(value: Json, group: Group, base: Group) -> tuple[str, ...]:
    """The sizes that a group's pitch had; exports of before do not say more than two of them."""
    if "pitches" in value:
        return _require_digests(value["pitches"])
    return tuple(dict.fromkeys(map(format_pitch_size, (base.pitch, group.pitch))))


def _require_digests(value: Json) -> tuple[str, ...]:
    return tuple(_require_text(item) for item in _require_list(value, MAX_STATES))


def _describe_value(value: Json) -> str:
    """What a value is, for a sentence."""
    if isinstance(value, str):
        return f"a text of {len(value)} letters"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "an object" if isinstance(value, dict) else json_text(value)[:40]


def _require_object(value: Json) -> dict[str, Json]:
    if not isinstance(value, dict):
        raise InputError(f"has {_describe_value(value)} where an object is expected")
    return value


def _require_list(value: Json, most: int) -> list[Json]:
    if not isinstance(value, list) or len(value) > most:
        raise InputError(f"has {_describe_value(value)} where a list of at most {most} is expected")
    return value


def _require_text(value: Json, *, empty: bool = False, most: int = MAX_TEXT) -> str:
    if value == "" and not empty:
        raise InputError("has an empty text where a text is required")
    if not isinstance(value, str) or len(value) > most:
        raise InputError(
            f"has {_describe_value(value)} where a text of at most {most} characters is expected"
        )
    return value
