"""Figures from stored results: pure functions of the wire answers, with no database and no web."""
