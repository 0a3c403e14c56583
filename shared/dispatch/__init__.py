"""Wake-up messages between processes: the broker, and the one message that travels over it."""
