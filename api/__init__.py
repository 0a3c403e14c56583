"""The HTTP interface: FastAPI over the use cases of `services.jobs`."""
