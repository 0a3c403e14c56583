"""The wire: what people send and what they get, the same in YAML, JSON and Python (DESIGN: wire names)."""
