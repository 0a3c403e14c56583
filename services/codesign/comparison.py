"""Methods side by side: totals over the tasks, and the regret of each against the tasks' own optima."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

OWN = "own"
"""Name, among the totals, of every task solved with its own design: a lower bound for any one design."""


@dataclass(frozen=True)
class Comparison:
    """Totals are over the tasks that every method solved (`counted`), so that they may be compared."""

    counted: tuple[int, ...]  # indices of the tasks in the totals
    totals: Mapping[str, float]  # by method, `own` included; the objective's unit
    failed: Mapping[str, tuple[int, ...]]  # by method, `own` included: tasks without a motion
    regret: Mapping[str, tuple[float | None, ...]]  # by method and task: (value - own) / own
    total_regret: Mapping[str, float | None]  # by method, over the tasks counted; None when none is


def over_tasks(values: Sequence[float], weights: Sequence[float], worst_share: float) -> float:
    """What one design is judged by: the weighted sum, the worst task, or a mix, in units of the weighted sum.

    ``(1 - s) sum_k w_k v_k + s W max_k v_k`` with ``W = sum_k w_k`` and s = `worst_share`: 0 the sum, 1 the worst.
    """
    total = sum(weight * value for weight, value in zip(weights, values, strict=True))
    return (1 - worst_share) * total + (worst_share * sum(weights) * max(values) if worst_share else 0.0)


def compare(own: Sequence[float | None], methods: Mapping[str, Sequence[float | None]]) -> Comparison:
    """Compare objective values, one a task, None where there is no motion.

    Parameters
    ----------
    own
        Optimum of each task with a design of its own.
    methods
        By name, the values of the same tasks with that method's design.
    """
    columns = {OWN: own, **methods}
    failed = {name: tuple(k for k, value in enumerate(values) if value is None) for name, values in columns.items()}
    left_out = {k for tasks in failed.values() for k in tasks}
    counted = tuple(k for k in range(len(own)) if k not in left_out)
    totals = {name: sum(_known(values[k]) for k in counted) for name, values in columns.items()}
    return Comparison(
        counted=counted,
        totals=totals,
        failed=failed,
        regret={name: tuple(map(_regret, values, own)) for name, values in methods.items()},
        total_regret={name: _regret(totals[name], totals[OWN]) for name in methods},
    )


def _known(value: float | None) -> float:
    assert value is not None, "only tasks that every method solved are counted"
    return value


def _regret(value: float | None, own: float | None) -> float | None:
    # An energy that is given back is negative: what is worse must be positive all the same.
    return None if value is None or not own else (value - own) / abs(own)
