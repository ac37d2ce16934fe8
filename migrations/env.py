"""Alembic's entry: runs on the connection and in the transaction that app.store.migrate opens."""

from alembic import context

from app.store.tables import Base

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=Base.metadata,
    # The connection has begun a transaction that writes, and both engines' DDL is transactional.
    transactional_ddl=True,
)
context.run_migrations()
