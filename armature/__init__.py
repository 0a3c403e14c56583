"""What a person holds: the Python client, and the `armature` command."""

from armature.client import Application, Client
from armature.errors import (
    ArmatureError,
    ConflictError,
    FieldProblem,
    NotFoundError,
    ProblemError,
    RefusedError,
    ServerUnreachableError,
)

__all__ = [
    "Application",
    "ArmatureError",
    "Client",
    "ConflictError",
    "FieldProblem",
    "NotFoundError",
    "ProblemError",
    "RefusedError",
    "ServerUnreachableError",
]
