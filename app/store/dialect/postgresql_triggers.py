"""Statements of migrations that are written for SQLite, carried out by PostgreSQL."""

from __future__ import annotations

import re
from typing import Any

_TRIGGER = re.compile(
    r"CREATE TRIGGER (?P<name>\w+) (?P<moment>BEFORE|AFTER)"
    r" (?P<verb>INSERT|UPDATE|DELETE)(?P<columns> OF [\w, ]+)? ON (?P<table>\w+)\s+"
    r"(?:WHEN (?P<when>.*?)\s+)?BEGIN (?P<body>.*); END\s*",
    re.S,
)
_REFUSAL = re.compile(r"SELECT RAISE\(ABORT, '(?P<sentence>[^']*)'\)")
_DROP = re.compile(r"DROP TRIGGER (?P<name>\w+)\s*")
_NOTHING = "SELECT 1"
SCAN = "queue_scanned"
"""An index of 26 columns that SQLite's questions name; PostgreSQL chooses by itself, and would only
have to keep it up at every edit."""


def carry_out(cursor: Any, statement: str, *, new: bool) -> str:
    """Carry out what only SQLite understands; returns the statement that is left to be executed.

    Args:
        cursor: Of the driver.
        statement: As the migration says it.
        new: The database was empty: no rows are there to be brought up to date.
    """
    if statement.startswith("PRAGMA "):
        return _NOTHING
    if new and statement.startswith("UPDATE ") and "alembic_version" not in statement:
        return _NOTHING
    if statement.startswith(f"CREATE INDEX {SCAN} "):
        return _NOTHING
    if found := _TRIGGER.fullmatch(statement):
        cursor.execute(trigger(**found.groupdict()))
        return _NOTHING
    if found := _DROP.fullmatch(statement):
        # The trigger goes with its function.
        return f"DROP FUNCTION {found['name']} CASCADE"
    return statement


def trigger(
    name: str,
    moment: str,
    verb: str,
    columns: str | None,
    table: str,
    when: str | None,
    body: str,
) -> str:
    """The statements that make a function and the trigger that calls it, for each row.

    A condition goes into the function: only there may it ask other tables. What must not be
    deleted must not be truncated either.
    """
    row = "OLD" if verb == "DELETE" else "NEW"
    if refusal := _REFUSAL.fullmatch(body):
        body = f"RAISE EXCEPTION '{refusal['sentence']}' USING ERRCODE = '23000'"
    elif body == "SELECT RAISE(IGNORE)":
        body = "RETURN NULL"
    if when is not None:
        body = f"IF {_distinct(when)} THEN {body}; END IF"
    made = (
        f"CREATE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS"
        f" $$ BEGIN {body}; RETURN {row}; END $$;"
        f" CREATE TRIGGER {name} {moment} {verb}{columns or ''} ON {table}"
        f" FOR EACH ROW EXECUTE FUNCTION {name}();"
    )
    if refusal and verb == "DELETE":
        name = f"{table}_refuses_truncate"
        made += (
            f" CREATE OR REPLACE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS"
            f" $$ BEGIN RAISE EXCEPTION '{refusal['sentence']}' USING ERRCODE = '23000'; END $$;"
            f" CREATE OR REPLACE TRIGGER {name} BEFORE TRUNCATE ON {table}"
            f" FOR EACH STATEMENT EXECUTE FUNCTION {name}();"
        )
    return made


def _distinct(condition: str) -> str:
    """SQLite's IS NOT between values."""
    return re.sub(r"IS NOT (?=NEW\.|OLD\.)", "IS DISTINCT FROM ", condition)
