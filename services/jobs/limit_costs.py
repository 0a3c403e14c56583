"""Which limits hold a method's tasks back, and what relaxing each would bring, from the stored slopes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from services.codesign.limits import LimitSlope, unit_of
from shared.contracts.comparisons import LimitCost


def limits_wire(limits: Mapping[str, LimitSlope]) -> list[dict[str, Any]]:
    """Limits as they are stored with a motion, or with a design."""
    return [
        {"name": name, "value": limit.value, "slope": limit.slope, "span": limit.span, "unit": unit_of(name)}
        for name, limit in limits.items()
    ]


def limit_costs(
    motions: Mapping[int, list[dict[str, Any]]], shares: Mapping[int, float], of_design: list[dict[str, Any]]
) -> list[LimitCost]:
    """Costs over the tasks, the largest for one percent first.

    Parameters
    ----------
    motions
        By task, the limits that hold its motion back.
    shares
        By task, how much its objective counts.
    of_design
        Limits of a design that all tasks share, with slopes of the whole.
    """
    entries: dict[str, list[tuple[int | None, dict[str, Any]]]] = defaultdict(list)
    for task, limits in motions.items():
        for limit in limits:
            entries[limit["name"]].append((task, limit | {"slope": limit["slope"] * shares[task]}))
    for limit in of_design:
        entries[limit["name"]].append((None, limit))
    costs = [_cost(name, found) for name, found in entries.items()]
    return sorted(costs, key=lambda cost: -cost.gain_per_percent)


def _cost(name: str, found: list[tuple[int | None, dict[str, Any]]]) -> LimitCost:
    values = {limit["value"] for _, limit in found}
    slope = sum(limit["slope"] for _, limit in found)
    return LimitCost(
        name=name,
        value=values.pop() if len(values) == 1 else None,
        unit=found[0][1]["unit"],
        relax="raise" if slope < 0 else "lower",
        gain_per_unit=abs(slope),
        gain_per_percent=abs(sum(limit["slope"] * limit["span"] for _, limit in found)) / 100,
        tasks=[task for task, _ in found if task is not None],
        of_the_design=any(task is None for task, _ in found),
    )
