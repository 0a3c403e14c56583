"""The worker: Celery tasks that claim and execute jobs, and the relay that wakes them."""
