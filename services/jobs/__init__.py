"""Use cases of the queue: submit, plan, claim, execute, finish, cancel, retry, sweep, and views of what is stored."""
