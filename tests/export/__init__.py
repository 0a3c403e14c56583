"""Exported files load back to the same numbers."""
