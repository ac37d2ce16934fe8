"""Soundness: what SQLite itself finds wrong with its file."""

from __future__ import annotations

from sqlalchemy import text
from sqlalchemy.orm import Session


def file_faults(session: Session, most: int = 5, *, thorough: bool = False) -> list[str]:
    """What is wrong with pages and indexes, in SQLite's sentences, each one line.

    Args:
        session: Any.
        most: Sentences; SQLite may fail altogether where it looks on after the first.
        thorough: Compare each index with its table, too, which takes several times as long.
    """
    check = "integrity_check" if thorough else "quick_check"
    found = session.scalars(text(f"PRAGMA {check}({most})")).all()
    return [] if found == ["ok"] else [" ".join(sentence.split()) for sentence in found]


def count_lost_references(session: Session) -> int:
    """How many rows refer to rows that are gone."""
    return len(session.execute(text("PRAGMA foreign_key_check")).all())
