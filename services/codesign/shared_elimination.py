"""Order of elimination for the program of all tasks: every motion a chain of its own, the design last.

A motion's intervals are eliminated as in its own program, and with the last of them its t_f and the constraint that
holds its objective below the worst one's. What it leaves behind touches the design and the worst objective z alone.
"""

from __future__ import annotations

import numpy as np

from services.codesign.elimination import Elimination, border_stage, in_order, interval_stage, number_unknowns
from services.codesign.instance import Instance
from services.codesign.shared_program import SharedProgram


def shared_elimination(program: SharedProgram, instance: Instance) -> Elimination:
    """Order for the systems of one instance."""
    variable, slack, multiplier = number_unknowns(
        instance.lower_x != instance.upper_x, instance.lower_g == instance.upper_g
    )
    task, stages = program.task, []
    for k in range(program.tasks):
        own, rows = variable[program.variables_of(k)], program.constraints_of(k)
        motion = [interval_stage(task, w, own, slack[rows], multiplier[rows]) for w in range(task.intervals)]
        pairs, rest = motion.pop()
        worst = program.worst_rows[k : k + 1]
        last = np.concatenate([own[[task.time_index]], slack[worst], multiplier[worst]])
        stages += [*motion, (pairs, np.append(rest, last[last >= 0]))]
    rows = program.constraints_of(0)
    design = variable[program.variables_of(0)]
    design[task.time_index] = -1  # eliminated with its motion
    pairs, rest = border_stage(task, design, slack[rows], multiplier[rows])
    border = (pairs, np.append(rest, variable[-1]) if program.has_worst else rest)
    return in_order([*stages, border], program.constraints, range(0, len(stages) + 1, task.intervals))
