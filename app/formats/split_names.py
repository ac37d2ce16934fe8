"""Names of splits: one spelling of each, whatever a file calls it."""

from __future__ import annotations

import re

from app.formats.report import ReaderReport
from app.json_text import quote_text

UNASSIGNED = "unassigned"
"""Stands for the split of groups that are in none."""
_SPLIT = re.compile(r"(train|val|test|challenge)(?:ing|id|idation)?(?:[-_ ]?(?:set|\d{1,4}))?")
_NO_FILE_NAME = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]+')
_LONGEST = 50
"""Characters of a split in a name of a file, which has 255 bytes at most."""
_LONGEST_KEPT = 1000


def parse_split_name(name: str) -> str:
    """The split that a name is; empty where it is none.

    Example:
        >>> [parse_split_name(name) for name in ("train2017", "Validation", "val", "cam1")]
        ['train', 'valid', 'valid', '']
    """
    found = _SPLIT.fullmatch(name.strip().lower())
    return "" if found is None else {"val": "valid"}.get(found[1], found[1])


def read_split_name(name: str, report: ReaderReport) -> str:
    """The split that a file puts something into, as it is called here.

    A name of another split stays as it is, and the report names it.
    """
    found, own = parse_split_name(name), name.strip()[:_LONGEST_KEPT]
    if own and not found:
        report.add_remark(
            f"The split {quote_text(own, 50)} is none of train, valid, test and challenge: it"
            " stays as it is called, and nothing of it trains in a YOLO export."
        )
    return found or own


def split_in_file_name(split: str) -> str:
    """A split as a part of a name of a file: never a folder, and never nothing.

    Example:
        >>> split_in_file_name("test"), split_in_file_name("fold/1"), split_in_file_name("")
        ('test', 'fold-1', 'unassigned')
    """
    return _NO_FILE_NAME.sub("-", split).strip(". ")[:_LONGEST] or UNASSIGNED
