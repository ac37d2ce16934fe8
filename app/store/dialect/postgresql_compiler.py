"""What SQLAlchemy writes for PostgreSQL, where SQLite would do something else with its own."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Column, Constraint, String
from sqlalchemy.dialects.postgresql.base import PGDDLCompiler, PGTypeCompiler
from sqlalchemy.dialects.postgresql.psycopg import PGDialect_psycopg

_Compiler: Any = PGDialect_psycopg.statement_compiler


class Statements(_Compiler):  # type: ignore[misc]
    """LIKE that takes no notice of the case of ASCII letters; the columns' collation is C."""

    def visit_like_op_binary(self, binary: Any, operator: Any, **kw: Any) -> str:
        """ILIKE."""
        return str(self.visit_ilike_op_binary(binary, operator, **kw))

    def visit_not_like_op_binary(self, binary: Any, operator: Any, **kw: Any) -> str:
        """NOT ILIKE."""
        return str(self.visit_not_ilike_op_binary(binary, operator, **kw))


class Types(PGTypeCompiler):
    """Whole numbers of 64 bits."""

    def visit_INTEGER(self, type_: Any, **kw: Any) -> str:
        """BIGINT."""
        return "BIGINT"


class Columns(PGDDLCompiler):
    """Columns as they are created: collation "C" for text, bigint ids, deferrable references."""

    def get_column_specification(self, column: Column[Any], **kw: Any) -> str:
        """A column as it is created."""
        made: Any = super()
        text = str(made.get_column_specification(column, **kw)).replace(" SERIAL", " BIGSERIAL", 1)
        return f'{text} COLLATE "C"' if isinstance(column.type, String) else text

    def define_constraint_deferrability(self, constraint: Constraint) -> str:
        """When a constraint is checked: references at the end of a transaction, if that asks."""
        text = super().define_constraint_deferrability(constraint)
        is_reference = constraint.__visit_name__ == "foreign_key_constraint"
        return text or (" DEFERRABLE INITIALLY IMMEDIATE" if is_reference else "")
