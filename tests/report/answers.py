"""A small made-up application: a grid of two strokes and two payloads, three methods, two motors."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from services.codesign.design_sheet import motor_sheet
from services.codesign.motor_data import DIMENSIONS, MotorData
from services.report.answers import Answers
from shared.contracts.application import GridRequest, ObjectiveRequest
from shared.contracts.certificates import Certificate
from shared.contracts.comparisons import (
    ComparisonAnswer,
    DesignAnswer,
    DesignsAnswer,
    LimitCost,
    MethodTotals,
    OwnDesign,
    Regret,
    SharedDesign,
)
from shared.contracts.motions import MotionResult, TaskList, TaskResult, Trajectory, VoltageControl
from shared.contracts.states import ApplicationStatus, Progress, Timings

GRID = GridRequest(stroke=[0.5, 1.0], payload_kg=[0.0, 3.0])
NAMES = ["0.5 rad, 0 kg", "0.5 rad, 3 kg", "1 rad, 0 kg", "1 rad, 3 kg"]
VALUES = {
    "own": [1.0, 1.5, 2.0, 2.5],
    "two_step": [1.1, 1.6, 2.2, 2.5],
    "empirical": [1.0, 2.0, 2.2, None],
    "worst_case": [2.2, 1.28, 2.75, 2.5],
}
"""Objective of each task with each method; None: no motion."""

TABLE_I_MM = [20.0, 18.0, 30.0, 3.0, 5.0, 7.0, 2.0]
"""The paper's Table I, order of the dimensions."""
SMALL_MM = [40.0, 12.0, 29.0, 1.5, 5.5, 5.0, 1.0]
MOTOR = MotorData()

SPEED_LIMIT, TORQUE_LIMITS, CURRENT_LIMIT, VOLTAGE_LIMIT = 3.0, (200.0, 50.0), 3.0, 100.0
POINTS = 5


def own_designs_mm() -> list[list[list[float]]]:
    """One a task: stack lengths of motor 1 are 20, 24, 28, 40 mm."""
    return [[[length, *TABLE_I_MM[1:]], SMALL_MM] for length in (20.0, 24.0, 28.0, 40.0)]


def motion(task: int = 3, method: str = "two_step") -> Trajectory:
    """Two joints; joint 1 reaches half of each limit, joint 2 stands still."""
    wave = [math.sin(math.pi * k / (POINTS - 1)) for k in range(POINTS)]

    def column(largest: float) -> list[list[float]]:
        return [[largest * value, 0.0] for value in wave]

    return Trajectory(
        application_id="a",
        task=task,
        method=method,
        time_s=[0.1 * k for k in range(POINTS)],
        joint_position_rad=column(1.0),
        joint_speed_rad_s=column(SPEED_LIMIT / 2),
        joint_torque_Nm=column(TORQUE_LIMITS[0] / 2),
        current_d_A=column(0.0),
        current_q_A=column(-CURRENT_LIMIT / 2),
        voltage_d_V=column(0.0),
        voltage_q_V=column(VOLTAGE_LIMIT / 2),
        control=VoltageControl(
            kind="piecewise_constant",
            description="constant on each interval",
            breaks_s=[0.1 * k for k in range(POINTS)],
            voltage_d_V=[[row] for row in column(0.0)[1:]],
            voltage_q_V=[[row] for row in column(VOLTAGE_LIMIT / 2)[1:]],
        ),
        design_mm=[TABLE_I_MM, SMALL_MM],
        scheme="radau",
        degree=1,
    )


def result(value: float) -> MotionResult:
    """What belongs to `motion`."""
    half = ("rotor_speed", "joint_torque", "current_q", "voltage_q")
    shares = {name: [0.5, 0.0] if name in half else [0.0, 0.0] for name in (*half, "current_d", "voltage_d")}
    return MotionResult(
        objective=value,
        final_time_s=value,
        energy_V2s=10 * value,
        electrical_energy_J=value,
        copper_loss_J=value,
        recovered_energy_J=[0.0, 0.0],
        peaks=shares,
        rms=shares,
        certificate=Certificate(kkt_residual=1e-9, limit_violation=0.0),
        design_mm=[TABLE_I_MM, SMALL_MM],
        solver_status="Solve_Succeeded",
        iterations=10,
        solve_time_s=0.1,
    )


def tasks() -> TaskList:
    """Every task with its results."""
    items = [
        TaskResult(
            index=k,
            name=name,
            payload_kg=0.0,
            weight=1.0,
            state="succeeded",
            own=result(VALUES["own"][k] or 0.0),
            methods={m: result(v) for m in VALUES if m != "own" and (v := VALUES[m][k]) is not None},
        )
        for k, name in enumerate(NAMES)
    ]
    return TaskList(items=items, next_cursor=None)


def comparison() -> ComparisonAnswer:
    """Over the first three tasks, which every method solved."""
    counted = [0, 1, 2]
    own = [VALUES["own"][k] or 0.0 for k in counted]
    methods, regret = {}, {}
    for name, values in VALUES.items():
        solved = [values[k] or 0.0 for k in counted]
        total = sum(solved)
        methods[name] = MethodTotals(
            total_objective=total,
            weighted_objective=total,
            worst_objective=max(solved),
            worst_task=counted[solved.index(max(solved))],
            total_time_s=total,
            total_energy_V2s=10 * total,
            total_electrical_energy_J=total,
            total_copper_loss_J=total,
            per_task=[{"objective": value} for value in solved],
            design_mm=None,
        )
        if name != "own":
            each = [value / best - 1 for value, best in zip(solved, own, strict=True)]
            regret[name] = Regret(total=total / sum(own) - 1, per_task=[*each])
    return ComparisonAnswer(
        objective="time",
        unit="s",
        tasks_compared=counted,
        task_names=[NAMES[k] for k in counted],
        task_weights=[1.0] * len(counted),
        grid=GRID,
        methods=methods,
        regret=regret,
        limits={
            "two_step": [limit_cost("current_limit_A", 3.0, "A", "raise", [0, 2])],
            "own": [
                limit_cost("current_limit_A", 3.0, "A", "raise", [0, 1, 2]),
                limit_cost("joint_position_limit_rad[0].low", None, "rad", "lower", []),
            ],
        },
        missing={},
    )


def limit_cost(
    name: str, value: float | None, unit: str, relax: Literal["raise", "lower"], tasks: list[int]
) -> LimitCost:
    """Half a second for each unit."""
    return LimitCost(
        name=name,
        value=value,
        unit=unit,
        relax=relax,
        gain_per_unit=0.5,
        gain_per_percent=0.005 * (value or 1.0),
        tasks=tasks,
        of_the_design=not tasks,
    )


def designs() -> DesignsAnswer:
    """Own designs, and one for each method."""
    own = own_designs_mm()
    mean = np.mean(own, axis=0).tolist()
    return DesignsAnswer(
        dimensions=list(DIMENSIONS),
        tasks=[OwnDesign(index=k, name=NAMES[k], design_mm=design) for k, design in enumerate(own)],
        mean=SharedDesign(design_mm=mean),
        methods={
            "two_step": SharedDesign(design_mm=mean),
            "empirical": SharedDesign(design_mm=own[2], task=2),
            "worst_case": SharedDesign(design_mm=own[3], task=3),
        },
    )


def design() -> DesignAnswer:
    """The design sheet of Table I's motor and a smaller one."""
    rows = [TABLE_I_MM, SMALL_MM]
    motors = [motor_sheet(k, np.array(row) / 1e3, MOTOR) for k, row in enumerate(rows)]
    return DesignAnswer(application_id="a", method="two_step", motors=motors, design_mm=rows)


def application() -> ApplicationStatus:
    """The application itself."""
    return ApplicationStatus(
        id="a",
        name="made up",
        state="succeeded",
        reason=None,
        cancel_requested=False,
        progress=Progress(stages=[], done=0, total=0, eta_s=None),
        objective=ObjectiveRequest(kind="time"),
        method="two_step",
        methods=["two_step", "empirical", "worst_case"],
        robot="somebody's",
        tasks=4,
        grid=GRID,
        excluded_tasks=[],
        timings=Timings(solver_time_s=1.0, worker_time_s=1.0, wall_time_s=1.0),
        created_at="",
        started_at=None,
        finished_at=None,
        tags=[],
        versions={},
    )


def answers() -> Answers:
    """All of it."""
    return Answers(application(), tasks(), design(), designs(), comparison(), (motion(),), MOTOR, robot=None)
