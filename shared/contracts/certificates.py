"""What was found out about a motion apart from its solve: replay, limits, energy balances, optimality."""

from __future__ import annotations

from pydantic import BaseModel, Field


class LimitCheck(BaseModel):
    """How far a kind of limit is exceeded, as a share of it (of the range for joints); 0 when it is kept."""

    at_points: float | None = Field(description="by the motion at its grid points")
    between_points: float | None = Field(description="by the replay, densely; null when it broke off")


class ElectricalBalance(BaseModel):
    """Electrical input = copper loss + change of field energy + shaft work, on the replay, all motors together."""

    input_J: float
    copper_J: float
    field_change_J: float
    shaft_J: float
    residual_J: float
    turned_over_J: float = Field(description="sum of the sizes of the terms")
    closed: bool = Field(description="residual within 1e-6 of what was turned over")


class MechanicalBalance(BaseModel):
    """Shaft work = change of kinetic and potential energy, rotors included, + friction at the joints, on the replay."""

    shaft_J: float
    kinetic_and_potential_change_J: float
    friction_J: float = Field(0.0, description="lost at the joints")
    residual_J: float
    turned_over_J: float = Field(description="sum of the sizes of the terms")
    closed: bool = Field(description="residual within 1e-6 of what was turned over")


class EnergyBalance(BaseModel):
    """Both balances."""

    electrical: ElectricalBalance
    mechanical: MechanicalBalance


class Tolerance(BaseModel):
    """What a certificate is judged by."""

    position_rad: float
    speed_rad_s: float
    limit: float = Field(description="share by which a limit may be exceeded")


class Refinement(BaseModel):
    """One solve on the way to the accuracy that was asked for, and what its replay found."""

    degree: int
    intervals: int
    replay_position_rad: float | None
    replay_speed_rad_s: float | None
    limit_violation: float | None


class Certificate(BaseModel):
    """What was found when a motion's voltages were replayed by an accurate integrator, and how nearly it is optimal.

    Everything is computed apart from the solver and the transcription. Figures of a failed solve are null.
    """

    replay_position_rad: float | None = Field(None, description="to the task's end at t_f, largest over the joints")
    replay_speed_rad_s: float | None = Field(
        None, description="to the task's end speed at t_f, largest over the joints"
    )
    path_position_rad: float | None = Field(None, description="between replay and motion, largest at the grid points")
    path_speed_rad_s: float | None = Field(None, description="between replay and motion, largest at the grid points")
    limit_violation: float | None = Field(
        None, description="largest of `limits`: share of the limit, 0 when all are kept"
    )
    limits: dict[str, LimitCheck] | None = Field(None, description="joint_range, rotor_speed, current, voltage")
    kkt_residual: float | None = Field(description="scaled; recomputed from the program with the multipliers")
    constraint_violation: float | None = Field(None, description="of the program at the solution, scaled")
    energy_balance: EnergyBalance | None = None
    tolerance: Tolerance | None = None
    within_tolerance: bool | None = Field(None, description="whether replay and limits meet `tolerance`")
    as_requested: bool | None = Field(
        None, description="the transcription was asked for as it is, so a missed tolerance is no failure"
    )
    scheme: str | None = None
    degree: int | None = None
    intervals: int | None = None
    control: str | None = None
    refinements: list[Refinement] | None = Field(None, description="solves on the way to the accuracy, the last too")
    input_hash: str | None = Field(None, description="SHA-256 of robot, task, motor, objective, transcription, design")
