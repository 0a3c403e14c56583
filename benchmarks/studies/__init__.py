"""Studies of the methods on whole applications; their answers are kept in benchmarks/results, for docs/ and tests/."""
