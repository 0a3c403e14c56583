"""What every part of the service agrees on: states, wire contracts, settings, database, dispatch."""
