"""What a person holds: the Python client, and the `armature` command."""

from armature.async_client import AsyncApplication, AsyncClient, AsyncSweep
from armature.builder import ApplicationBuilder
from armature.client import Application, Client
from armature.errors import (
    AccessError,
    ApplicationFileError,
    ArmatureError,
    ConflictError,
    FieldProblem,
    MissingExtraError,
    NotFoundError,
    ProblemError,
    RefusedError,
    ServerUnreachableError,
    TooManyRequestsError,
    UnexpectedAnswerError,
)
from armature.results import AsyncResults, Results
from armature.sweep import Sweep

__all__ = [
    "AccessError",
    "Application",
    "ApplicationBuilder",
    "ApplicationFileError",
    "ArmatureError",
    "AsyncApplication",
    "AsyncClient",
    "AsyncResults",
    "AsyncSweep",
    "Client",
    "ConflictError",
    "FieldProblem",
    "MissingExtraError",
    "NotFoundError",
    "ProblemError",
    "RefusedError",
    "Results",
    "ServerUnreachableError",
    "Sweep",
    "TooManyRequestsError",
    "UnexpectedAnswerError",
]
