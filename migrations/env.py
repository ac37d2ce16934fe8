"""Alembic's entry: runs on the connection and in the transaction that app.db.migrate opens."""

from alembic import context

from app.features.tables import Base

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=Base.metadata,
    # The connection has begun a transaction that writes, and both engines' DDL is transactional.
    transactional_ddl=True,
)
context.run_migrations()
