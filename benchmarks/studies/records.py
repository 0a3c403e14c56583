"""Applications are run once, through the embedded service, and what it answers is kept.

A study is a mapping from names to requests. What is stored already for the same request is not run again, and every
answer is stored as soon as it is there: an interrupted study goes on where it stopped. Every answer has the digest of
the solver's sources that it was made with; with `--again` those of other sources are run again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armature.client import Client
from armature.processes import Place, running_service
from services.codesign.comparison import over_tasks
from services.codesign.kernels import default_cache
from shared.contracts.comparisons import ComparisonAnswer, DesignsAnswer
from shared.contracts.states import ApplicationStatus
from shared.contracts.sweeps import SweepStatus
from shared.settings import Settings

RESULTS = Path(__file__).parents[1] / "results"
SOLVER = Path(__file__).parents[2] / "services" / "codesign"
DIGITS = 9
"""Significant digits that are kept: three more than the solver's tolerance gives."""

PAPER = {"scheme": "radau", "degree": 1, "intervals": 50, "control": "voltage"}
ALL_METHODS = {"method": "shared_optimum", "compare": ["two_step", "empirical", "worst_case"]}


@dataclass(frozen=True)
class Record:
    """One application: what was asked and what came of it."""

    request: Mapping[str, Any]
    status: ApplicationStatus
    comparison: ComparisonAnswer
    designs: DesignsAnswer
    objectives: Mapping[str, tuple[float | None, ...]]  # by method, one a task, None without a motion
    weights: tuple[float, ...]  # one a task

    def undone(self, method: str) -> int:
        """How many tasks the method has no motion for."""
        return self.objectives[method].count(None)

    def judged(self, method: str) -> float | None:
        """What the design is for, over all tasks; None when one of them has no motion."""
        values = [value for value in self.objectives[method] if value is not None]
        share = self.status.objective.over_tasks.worst_share
        return None if self.undone(method) else over_tasks(values, self.weights, share)


def read(study: str) -> dict[str, Record]:
    """The records of a study, by name."""
    return {name: _record(content) for name, content in _stored(study).items()}


def solver_digest() -> str:
    """Of the sources that make the numbers, comments included: equal for results that are of one solver."""
    sources = sorted(path for path in SOLVER.iterdir() if path.suffix in (".py", ".c"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]


def asked_again(description: str | None) -> bool:
    """Whether the command line of a study asks for what other sources made to be run again."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--again", action="store_true", help="run again what another solver made")
    return bool(parser.parse_args().again)


def run(
    study: str, requests: Mapping[str, Mapping[str, Any]], workers: int = 1, *, again: bool = False
) -> dict[str, Record]:
    """Run what is not stored yet, `again` what other sources made, and return all records as they are asked for."""
    stored, solver = _stored(study), solver_digest()
    left = {
        name: request
        for name, request in requests.items()
        if name not in stored or stored[name]["request"] != request or (again and stored[name].get("solver") != solver)
    }
    if left:
        with embedded_service(workers) as client:
            for name, request in left.items():
                stored[name] = _answers(client, request) | {"solver": solver}
                keep(study, {key: stored[key] for key in requests if key in stored})
                print(f"{study}: {name}", flush=True)
    return {name: _record(stored[name]) for name in requests}


def stored_sweep(study: str, request: Mapping[str, Any] | None = None, *, again: bool = False) -> SweepStatus | None:
    """A stored sweep; None when there is none, or of another request, or, `again`, of other sources."""
    content = _stored(study)
    if not content or request not in (None, content["request"]):
        return None
    if again and content.get("solver") != solver_digest():
        return None
    return SweepStatus.model_validate(content["sweep"])


@contextmanager
def embedded_service(workers: int = 1) -> Iterator[Client]:
    """The whole service on this machine, in a home of its own, with the kernels that are compiled already."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        default_cache().mkdir(parents=True, exist_ok=True)
        (home / "kernels").symlink_to(default_cache())
        with running_service(Settings(home=home), Place(workers=workers)) as service, Client(service.url) as client:
            yield client


def keep(study: str, content: Mapping[str, Any]) -> None:
    """Store a study: one line a record, so that a record that changes is one line of a difference."""
    lines = [f" {json.dumps(name)}: {json.dumps(_rounded(value))}" for name, value in content.items()]
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{study}.json"
    beside = path.with_suffix(".tmp")
    beside.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    beside.replace(path)


def _stored(study: str) -> dict[str, Any]:
    path = RESULTS / f"{study}.json"
    found: dict[str, Any] = json.loads(path.read_bytes()) if path.exists() else {}
    return found


def _answers(client: Client, request: Mapping[str, Any]) -> dict[str, Any]:
    application = client.submit(request)
    status = application.wait()
    tasks = application.tasks()
    return {
        "request": request,
        "status": status.model_dump(mode="json"),
        "comparison": application.comparison().model_dump(mode="json"),
        "designs": application.designs().model_dump(mode="json"),
        "objectives": {
            "own": [task.own and task.own.objective for task in tasks],
            **{
                method: [task.methods[method].objective if method in task.methods else None for task in tasks]
                for method in status.methods
            },
        },
        "weights": [task.weight for task in tasks],
    }


def _record(content: Mapping[str, Any]) -> Record:
    return Record(
        request=content["request"],
        status=ApplicationStatus.model_validate(content["status"]),
        comparison=ComparisonAnswer.model_validate(content["comparison"]),
        designs=DesignsAnswer.model_validate(content["designs"]),
        objectives={method: tuple(values) for method, values in content["objectives"].items()},
        weights=tuple(content["weights"]),
    )


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, Mapping):
        return {key: _rounded(part) for key, part in value.items()}
    return [_rounded(part) for part in value] if isinstance(value, list | tuple) else value
