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
from armature.sweep import Sweep

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
    "Sweep",
]
