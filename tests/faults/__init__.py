"""Real processes, killed and frozen; judged by the history in the database."""
