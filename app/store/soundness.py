"""Soundness: what SQLite itself finds wrong with its file."""

from __future__ import annotations

from sqlalchemy import text
from sqlalchemy.orm import Session


def file_faults(session: Session) -> list[str]:
    """What is wrong with pages and indexes, up to five sentences of SQLite's."""
    found = [str(row[0]) for row in session.execute(text("PRAGMA quick_check(5)"))]
    return [] if found == ["ok"] else found


def count_lost_references(session: Session) -> int:
    """How many rows refer to rows that are gone."""
    return len(session.execute(text("PRAGMA foreign_key_check")).all())
