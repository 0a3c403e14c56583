"""In which order the unknowns of IPOPT's linear systems are eliminated: interval by interval, then the border.

IPOPT's unknowns are ``[free variables, slacks of the inequalities, multipliers of the equalities, multipliers of the
inequalities]``. A stage of the elimination is an interval w: its constraints, its own variables, and the state at
its start, which the interval before holds as its end. So a front carries the end state on to the next interval, and
design and t_f all the way to the border.

Within a stage the pairs come first: a variable and a constraint that fixes it with few other variables in it, listed
in an order in which each still has its variable. What is no pair is eliminated by dense pivoting.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from services.codesign.instance import Instance
from services.codesign.interval import IntervalLayout
from services.codesign.kept import Kept
from services.codesign.program import Program


@dataclass(frozen=True)
class Elimination:
    """An order of elimination, in stages; and chains of stages, of which all but the last may be eliminated at once."""

    order: np.ndarray  # (n,) unknown at each position
    first: np.ndarray  # (stages + 1,) position at which each stage begins
    pairs: np.ndarray  # (stages,) number of (variable, constraint) pairs that each stage begins with
    chains: np.ndarray = field(default_factory=lambda: np.zeros(1, dtype=np.int32))  # (chains,) stage each begins at
    multipliers: int = 0  # as many negative eigenvalues IPOPT wants: more may end a factorisation early. 0: unknown


_KNOWN: Kept[Elimination] = Kept(64)


def elimination(program: Program, instance: Instance) -> Elimination:
    """Order for the systems of one instance: which variables are pinned and which constraints are equalities matters.

    A constraint without bounds counts as an inequality, as IPOPT has it. Found once for tasks alike.
    """
    free = instance.lower_x != instance.upper_x
    equality = instance.lower_g == instance.upper_g
    key = (program.layout, free.tobytes(), equality.tobytes())
    return _KNOWN.get(key, lambda: _find(program, free, equality))


def _find(program: Program, free: np.ndarray, equality: np.ndarray) -> Elimination:
    numbers = number_unknowns(free, equality)
    stages = [interval_stage(program, w, *numbers) for w in range(program.intervals)]
    return in_order([*stages, border_stage(program, *numbers)], program.constraints)


def number_unknowns(free: np.ndarray, equality: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unknown of each variable (-1: pinned), of each constraint's slack (-1: none), and of each multiplier."""
    variables, inequalities = int(free.sum()), int((~equality).sum())
    variable = np.where(free, np.cumsum(free) - 1, -1)
    slack = np.where(equality, -1, variables + np.cumsum(~equality) - 1)
    first_multiplier = variables + inequalities
    multiplier = first_multiplier + np.where(equality, np.cumsum(equality), equality.sum() + np.cumsum(~equality)) - 1
    return variable, slack, multiplier


def in_order(
    stages: list[tuple[np.ndarray, np.ndarray]], multipliers: int, chains: Sequence[int] = (0,)
) -> Elimination:
    """Stages, each as its pairs (m, 2) and its other unknowns, one after the other; `chains` begin at these stages."""
    order = [part for pairs, rest in stages for part in (np.ravel(pairs), rest)]
    sizes = [2 * len(pairs) + len(rest) for pairs, rest in stages]
    return Elimination(
        order=np.concatenate(order).astype(np.int32),
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32),
        pairs=np.array([len(pairs) for pairs, _ in stages], dtype=np.int32),
        chains=np.array(chains, dtype=np.int32),
        multipliers=multipliers,
    )


def interval_stage(
    program: Program, w: int, variable: np.ndarray, slack: np.ndarray, multiplier: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (m, 2) and other unknowns of interval w: all that no later interval needs."""
    layout = program.layout
    begin = program.time_index + 1 + w * layout.variables
    own = variable[begin : begin + layout.variables]
    end = np.array(layout.end_state)
    start = own[:0] if w == 0 else variable[begin - layout.variables + end]
    rows = slice(w * program.interval_constraints, (w + 1) * program.interval_constraints)
    y, s = multiplier[rows], slack[rows]

    candidates = [
        np.column_stack([s, y])[s >= 0],
        *([] if layout.control == "current" else [_voltage_pairs(layout, own, y)]),
        _position_pairs(layout, own, start, y),
        *([_end_pairs(layout, own, y)] if layout.has_end_state else []),
        *([] if layout.control == "current" else [_current_pairs(layout, own, y)]),
    ]
    pairs = np.concatenate(candidates)
    pairs = pairs[(pairs >= 0).all(axis=1)]
    inner = own if w == program.intervals - 1 else np.delete(own, end)
    everything = np.concatenate([start[::-1], inner, y])
    rest = everything[(everything >= 0) & ~np.isin(everything, pairs)]
    return pairs, rest


def _voltage_pairs(layout: IntervalLayout, own: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The interval's voltages with the motor equations at its last point."""
    n = layout.joints
    first = (layout.degree - 1) * layout.point_size + 2 * n
    return np.column_stack([own[-2 * n :], y[first : first + 2 * n]])


def _position_pairs(layout: IntervalLayout, own: np.ndarray, start: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Positions at each point but the last with the kinematic defect at the next point."""
    n, size = layout.joints, layout.point_size
    before = [start[:n] if len(start) else np.full(n, -1)]
    before += [own[j * size : j * size + n] for j in range(layout.degree - 1)]
    defects = [y[j * size : j * size + n] for j in range(layout.degree)]
    return np.concatenate([np.column_stack(pair) for pair in zip(before, defects, strict=True)])


def _end_pairs(layout: IntervalLayout, own: np.ndarray, y: np.ndarray) -> np.ndarray:
    """States at the last point with the equations that extrapolate them to the interval's end."""
    size = layout.point_size
    first = (layout.degree - 1) * size
    return np.column_stack([own[first : first + size], y[layout.degree * size : (layout.degree + 1) * size]])


def _current_pairs(layout: IntervalLayout, own: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Currents at each point but the last with the motor equations there."""
    n, size = layout.joints, layout.point_size
    at = [np.arange(j * size + 2 * n, j * size + 4 * n) for j in range(layout.degree - 1)]
    index = np.concatenate(at) if at else np.empty(0, dtype=int)
    return np.column_stack([own[index], y[index]])


def border_stage(
    program: Program, variable: np.ndarray, slack: np.ndarray, multiplier: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Slacks of the motors' constraints with their multipliers; then t_f and design.

    t_f comes first, for most pairs of the intervals have it: what they do to it lies side by side in its column.
    """
    first = program.intervals * program.interval_constraints
    motors = slice(first, first + program.motor_constraints)
    s, y = slack[motors], multiplier[motors]
    pairs = np.column_stack([s, y])[s >= 0]
    shared = np.roll(variable[: program.time_index + 1], 1)
    return pairs, np.concatenate([shared[shared >= 0], y[s < 0]])
