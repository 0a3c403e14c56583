"""The database: tables, engine, clock."""
