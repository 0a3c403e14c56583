"""The worker as it is, but for the solves, which take `ARMATURE_TEST_SOLVE_S` and do nothing."""

from __future__ import annotations

import os
import time
from typing import Any

import worker.main
import worker.run_job
from services.jobs.finish import Outcome
from tests.service.queue_actions import outcome_of


def stand_in(work: Any, _options: Any, _progress: Any) -> Outcome:
    """In place of `services.jobs.execute.execute`."""
    time.sleep(float(os.environ["ARMATURE_TEST_SOLVE_S"]))
    return outcome_of(work)  # which looks at `spec` only


if __name__ == "__main__":
    worker.run_job.execute = stand_in
    worker.main.main()
