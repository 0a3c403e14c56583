"""Order of elimination for the program of all tasks: motion after motion, the design last.

A motion's intervals are eliminated as in its own program, and its t_f with the last of them. What it leaves behind
touches the design alone, and is handed on through the stages of the motions that follow.
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
        final_time = own[task.time_index]
        stages += [*motion, (pairs, np.append(rest, final_time) if final_time >= 0 else rest)]
    rows = program.constraints_of(0)
    design = variable[program.variables_of(0)]
    design[task.time_index] = -1  # eliminated with its motion
    return in_order([*stages, border_stage(task, design, slack[rows], multiplier[rows])])
