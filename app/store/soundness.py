"""Soundness: what a database itself finds wrong with its file."""

from __future__ import annotations

from app.store.dialect.dialect import dialect_in
from app.store.session import Session


def file_faults(session: Session, most: int = 5, *, thorough: bool = False) -> list[str]:
    """What is wrong with pages and indexes, in SQLite's sentences, each one line.

    A server looks after its own files: of PostgreSQL there are none.

    Args:
        session: Any.
        most: Sentences; SQLite may fail altogether where it looks on after the first.
        thorough: Compare each index with its table, too, which takes several times as long.
    """
    return dialect_in(session).file_faults(session, most, thorough=thorough)


def count_lost_references(session: Session) -> int:
    """How many rows refer to rows that are gone."""
    return dialect_in(session).count_lost_references(session)


def restoring(session: Session) -> str:
    """How a copy is put into the place of this database, as a sentence."""
    return dialect_in(session).restoring


def no_fault(session: Session) -> str:
    """What is said where neither was found."""
    return dialect_in(session).no_fault
