"""Damage: sound files made wrong, with knowledge of what they are made of."""

from __future__ import annotations

import csv
import io
import json
import random
import re
import zipfile
from dataclasses import replace
from typing import Any

from tests.fuzz.case import Case, Files

VALUES: tuple[Any, ...] = (
    None, True, False, "", " ", "text", 0, 1, -1, 5, 12, 3.5, -0.0, 1e7, -1e7, 1e6, 1e-320, 1e308,
    -1e308, 2**31, 2**53 + 1, 2**63, 2**70, 10**400, "1", "5.0", "NaN", "Infinity", "-inf", "1e999",
    "0x10", "１", [], {}, [None], [[]], [5], [1, 2], [1, 2, 3, 4], ["a"] * 4, {"x": 1}, {"": {}},
    [[[]]], {"x1": "Infinity"}, "../../etc/passwd", "a\x00b", "é" * 300, "a/" * 200, "=1+1",
    "\x1b[31m", "\ud800", "‮", "Line unknown", "Circle central", "ball", "2015-08-08", "{", "[1, 2",
)  # fmt: skip
"""What a value becomes."""
WORDS = (
    "NaN", "Infinity", "-Infinity", "1e999", "null", "{", "}", "[", "]", ",", '"', "\\u0000", "\\ud800",
    "&lt;", "<!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/passwd'>]>", "<", ">", "''", "=", "\n", "\r",
    "\t", ";", "- a", "&a", "*a", "!!python/object:os.system", "<<: *a", "---", "\x00", "\ufeff", "1:2",
    "0:99999", "999999999:999999999", "-", "0" * 400, "9" * 400, "٣", "\x85",
)  # fmt: skip
"""What is put into a text."""
_TEXTS = (".json", ".jsonl", ".csv", ".txt", ".yaml", ".xgtf")


def damage(case: Case, dice: random.Random) -> Case:
    """A case with one to four faults; now and then as a zip, sound or damaged."""
    files = dict(case.files)
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        name = dice.choice([*files])
        _damage_file(files, name, dice)
        if not files:
            break
    found = replace(case, files=files)
    if case.given or dice.random() < 0.85:
        return found
    return _packed(found, dice)


def _damage_file(files: Files, name: str, dice: random.Random) -> None:
    roll = dice.random()
    if roll < 0.03:
        del files[name]
    elif roll < 0.06:
        files[dice.choice((f"b/{name}", f"{name}.json", "match_info.json", f"x{name}"))] = files[
            name
        ]
    elif roll < 0.08:
        files[name] = dice.choice((b"", b"\xef\xbb\xbf", b"[]", b"{}", b"\xff\xfe", b"null", b"PK"))
    else:
        files[name] = _damaged(name, files[name], dice)


def _damaged(name: str, content: bytes, dice: random.Random) -> bytes:
    roll = dice.random()
    if name.endswith(".json") and roll < 0.75:
        return _damaged_json(content, dice)
    if name.endswith(".jsonl") and roll < 0.75:
        lines = content.splitlines(keepends=True)
        if lines:
            number = dice.randrange(len(lines))
            lines[number] = _damaged_json(lines[number], dice) + b"\n"
        return b"".join(lines)
    if name.endswith(".csv") and roll < 0.7:
        return _damaged_csv(content, dice)
    if name.endswith(".xgtf") and roll < 0.7:
        return _damaged_xml(content, dice)
    if name.endswith(".parquet") and roll < 0.8:
        return _damaged_parquet(content, dice)
    if name.endswith(_TEXTS) and roll < 0.93:
        return _damaged_text(content, dice)
    return _damaged_bytes(content, dice)


def _damaged_json(content: bytes, dice: random.Random) -> bytes:
    try:
        value = json.loads(content)
    except ValueError:
        return _damaged_text(content, dice)
    places = list(_places(value))
    if not places:
        return json.dumps(dice.choice(VALUES)).encode()
    holder, key = dice.choice(places)
    roll = dice.random()
    if roll < 0.15:
        del holder[key]
    elif roll < 0.25 and isinstance(holder, list):
        holder.insert(key, holder[key])
    elif roll < 0.35 and isinstance(holder, dict):
        holder[dice.choice(("", "x", "id", "Line unknown", "\x00", *map(str, holder)))] = holder[
            key
        ]
    elif roll < 0.42:
        holder[key] = [holder[key]]
    elif roll < 0.45:
        holder[key] = json.dumps(holder[key])
    else:
        holder[key] = dice.choice(VALUES)
    return json.dumps(value).encode()


def _places(value: Any) -> Any:
    """Every (holder, key) of a JSON value, from the top down."""
    pending = [value]
    while pending:
        item = pending.pop()
        keys = (
            item if isinstance(item, dict) else range(len(item)) if isinstance(item, list) else ()
        )
        for key in keys:
            yield item, key
            pending.append(item[key])


def _damaged_csv(content: bytes, dice: random.Random) -> bytes:
    try:
        rows = list(csv.reader(io.StringIO(content.decode("utf-8", "replace"))))
    except csv.Error:
        return _damaged_text(content, dice)
    if not rows or not (cells := dice.choice(rows)):
        return b"\n"
    number = dice.randrange(len(cells))
    roll = dice.random()
    if roll < 0.1:
        del cells[number]
    elif roll < 0.2:
        rows.append(list(cells))
    elif roll < 0.5:
        cells[number] += dice.choice(WORDS)
    else:
        value = dice.choice(VALUES)
        cells[number] = value if isinstance(value, str) else json.dumps(value)
    out = io.StringIO()
    csv.writer(out).writerows(rows)
    return out.getvalue().encode("utf-8", "replace")


def _damaged_xml(content: bytes, dice: random.Random) -> bytes:
    text = content.decode("utf-8", "replace")
    attributes = list(re.finditer(r'(\w+)="([^"]*)"', text))
    if not attributes:
        return _damaged_text(content, dice)
    found = dice.choice(attributes)
    value = str(dice.choice((*VALUES, *WORDS)))[:500].replace('"', "&quot;")
    changed = dice.choice((f'{found[1]}="{value}"', "", f'x="{value}"', f"{found[0]} {found[0]}"))
    return (text[: found.start()] + changed + text[found.end() :]).encode("utf-8", "replace")


def _damaged_parquet(content: bytes, dice: random.Random) -> bytes:
    import pyarrow
    from pyarrow import parquet

    try:
        columns = parquet.read_table(io.BytesIO(content)).to_pydict()
    except (pyarrow.ArrowException, OSError, UnicodeError):
        return _damaged_bytes(content, dice)
    name = dice.choice([*columns])
    rows = columns[name]
    text = next((item for item in rows if isinstance(item, str)), "")
    if text.startswith(("{", "[")) and dice.random() < 0.7:
        columns[name] = [_damaged_json(text.encode(), dice).decode()] * len(rows)
    elif dice.random() < 0.2:
        del columns[name]
    else:
        columns[name] = [dice.choice(VALUES)] * len(rows)
    out = io.BytesIO()
    try:
        parquet.write_table(pyarrow.table(columns), out)
    except (pyarrow.ArrowException, OverflowError, UnicodeError, ValueError):
        return _damaged_bytes(content, dice)
    return out.getvalue()


def _damaged_text(content: bytes, dice: random.Random) -> bytes:
    place, word = dice.randrange(len(content) + 1), dice.choice(WORDS).encode()
    length = dice.choice((0, 0, 1, 5, 50))
    if dice.random() < 0.2:
        word = content[place : place + 200] * dice.choice((2, 100))
    return content[:place] + word + content[place + length :]


def _damaged_bytes(content: bytes, dice: random.Random) -> bytes:
    changed = bytearray(content)
    roll = dice.random()
    if roll < 0.2 or not changed:
        return bytes(changed[: dice.randrange(len(changed) + 1)])
    for _ in range(dice.choice((1, 1, 2, 8))):
        place = dice.randrange(len(changed))
        changed[place] = dice.choice((0, 0xFF, 0x7F, changed[place] ^ (1 << dice.randrange(8))))
    if roll > 0.9:
        place = dice.randrange(len(changed))
        changed[place:place] = dice.randbytes(dice.choice((1, 4, 300)))
    return bytes(changed)


def _packed(case: Case, dice: random.Random) -> Case:
    out = io.BytesIO()
    with zipfile.ZipFile(
        out, "w", dice.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    ) as packed:
        for name, content in case.files.items():
            entry = zipfile.ZipInfo(
                dice.choice((name, name, name, f"../{name}", name.upper(), f"é{name}"))
            )
            entry.external_attr = dice.choice((0o100644, 0o100644, 0o120777, 0o010644)) << 16
            packed.writestr(entry, content)
    content = out.getvalue()
    if dice.random() < 0.6:
        content = _damaged_bytes(content, dice)
    return Case(case.kind, {"archive.zip": content}, "archive.zip")
