"""Parts of statements that SQLite and PostgreSQL write differently."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

from sqlalchemy import Executable, Integer, LargeBinary, Select, String, Table, bindparam, select
from sqlalchemy.dialects.postgresql import Insert
from sqlalchemy.dialects.postgresql import insert as _insert
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.elements import ClauseElement
from sqlalchemy.sql.expression import TableValuedAlias
from sqlalchemy.sql.functions import FunctionElement

from app.finite import json_text


def insert(model: Any) -> Insert:
    """An INSERT that can say ON CONFLICT; both engines write it alike."""
    return _insert(model)


def insert_or_replace(model: Any) -> Insert:
    """An INSERT of rows in the place of those with the same key."""
    table = cast(Table, getattr(model, "__table__", model))
    statement = _insert(model)
    keys = list(table.primary_key.columns)
    changed = {item.name: statement.excluded[item.name] for item in table.c if item not in keys}
    return statement.on_conflict_do_update(index_elements=keys, set_=changed)


def numbers_in(ids: Iterable[int]) -> Select[Any]:
    """Some numbers as a question: one parameter, however many there are, for a statement takes a
    limited number of them."""
    return _numbers_in(json_text(list(ids)))


def numbers_given(name: str) -> Select[Any]:
    """As ``numbers_in``, in a statement that is made once: a parameter that is a JSON array."""
    return _numbers_in(bindparam(name, type_=String()))


def _numbers_in(array: Any) -> Select[Any]:
    listed = _Numbers(array).table_valued("value")
    return select(listed.c.value)


def texts_in(values: Iterable[str]) -> Select[Any]:
    """Some texts as a question."""
    listed = items_of(json_text(list(values)))
    return select(listed.c.value)


def items_of(array: Any) -> TableValuedAlias:
    """Rows (key, value) of a JSON array of texts in a text; keys count from 0."""
    return _Items(array).table_valued("key", "value")


def values_of(mapping: Any) -> TableValuedAlias:
    """Rows (value) of a JSON object whose values are texts, in a text."""
    return _Values(mapping).table_valued("value")


class _Numbers(FunctionElement[Any]):
    inherit_cache = True
    type = Integer()


class _Items(FunctionElement[Any]):
    inherit_cache = True


class _Values(FunctionElement[Any]):
    inherit_cache = True


class json_member(FunctionElement[str]):  # noqa: N801 - written like SQLAlchemy's functions
    """The text under a name in a JSON object in a text: ``member(column, "name")``."""

    inherit_cache = True
    type = String()

    def __init__(self, column: Any, name: str):
        super().__init__(column, f"$.{name}")


class larger_of(FunctionElement[Any]):  # noqa: N801 - written like SQLAlchemy's functions
    """The larger of two values that are there."""

    inherit_cache = True
    type = Integer()


class any_of(FunctionElement[bytes]):  # noqa: N801 - written like SQLAlchemy's functions
    """One of the bytes of each group of rows, which have all the same."""

    inherit_cache = True
    type = LargeBinary()


class pairs_of(FunctionElement[str]):  # noqa: N801 - written like SQLAlchemy's functions
    """The pairs of two columns of all rows, as a JSON array of arrays in a text."""

    inherit_cache = True
    type = String()


class DeferReferences(Executable, ClauseElement):
    """Until the transaction ends, rows may refer to rows that are not there yet."""

    inherit_cache = True


@compiles(_Numbers)
@compiles(_Items)
@compiles(_Values)
def _compile_json_each(element: Any, compiler: Any, **kw: Any) -> str:
    return f"json_each({compiler.process(element.clauses, **kw)})"


@compiles(_Numbers, "postgresql")
def _compile_numbers(element: Any, compiler: Any, **kw: Any) -> str:
    json = compiler.process(element.clauses, **kw)
    return (
        "(SELECT CAST(item AS BIGINT) AS value"
        f" FROM jsonb_array_elements_text(CAST({json} AS JSONB)) AS item)"
    )


@compiles(_Items, "postgresql")
def _compile_items(element: Any, compiler: Any, **kw: Any) -> str:
    json = compiler.process(element.clauses, **kw)
    return (
        "LATERAL (SELECT place - 1 AS key, item AS value"
        f" FROM jsonb_array_elements_text(CAST({json} AS JSONB))"
        " WITH ORDINALITY AS listed(item, place))"
    )


@compiles(_Values, "postgresql")
def _compile_values(element: Any, compiler: Any, **kw: Any) -> str:
    json = compiler.process(element.clauses, **kw)
    return f"LATERAL (SELECT pair.value FROM jsonb_each_text(CAST({json} AS JSONB)) AS pair)"


@compiles(json_member, "postgresql")
def _compile_member(element: Any, compiler: Any, **kw: Any) -> str:
    column, path = element.clauses
    column, path = compiler.process(column, **kw), compiler.process(path, **kw)
    return f"(CAST({column} AS JSONB) ->> substr({path}, 3))"


def _compile_as(kind: type[ClauseElement], form: str, *engine: str) -> None:
    """Have an element written in a form, whose ``{}`` are its arguments."""

    @compiles(kind, *engine)
    def _write(element: Any, compiler: Any, **kw: Any) -> str:
        return form.format(compiler.process(element.clauses, **kw))


_compile_as(json_member, "json_extract({})")
_compile_as(larger_of, "max({})")
_compile_as(larger_of, "greatest({})", "postgresql")
_compile_as(any_of, "min({})")
_compile_as(any_of, "(array_agg({}))[1]", "postgresql")
_compile_as(pairs_of, "json_group_array(json_array({}))")
_compile_as(pairs_of, "CAST(coalesce(json_agg(json_build_array({})), '[]') AS TEXT)", "postgresql")


@compiles(DeferReferences)
def _compile_deferral_for_sqlite(_element: Any, _compiler: Any, **_: Any) -> str:
    return "PRAGMA defer_foreign_keys = ON"


@compiles(DeferReferences, "postgresql")
def _compile_deferral_for_postgresql(_element: Any, _compiler: Any, **_: Any) -> str:
    return "SET CONSTRAINTS ALL DEFERRED"
