"""The paper's 25 tasks with every method, the shared optimum among them.

python -m benchmarks.studies.paper        results/paper.json
"""

from __future__ import annotations

from typing import Any

from armature.application_file import read_application
from benchmarks.studies.records import ALL_METHODS, asked_again, run
from benchmarks.tables import ROOT

STUDY = "paper"


def requests() -> dict[str, dict[str, Any]]:
    """The application of examples/pick_and_place.yaml."""
    asked = dict(read_application(ROOT / "examples" / "pick_and_place.yaml"))
    return {"time": asked | {"name": "paper: every method", **ALL_METHODS}}


def main() -> None:
    """Run what is not stored yet, and print the totals."""
    for name, record in run(STUDY, requests(), again=asked_again(__doc__)).items():
        print(name, {method: (record.judged(method), record.undone(method)) for method in record.objectives})


if __name__ == "__main__":
    main()
