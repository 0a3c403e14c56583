"""The motor: magnetic equivalent circuit of the paper's appendix, as CasADi expressions  (MODEL section 2).

A design vector is ``[L, R_ro, R_so, h_m, h_sy, w_tooth, b_0]`` in m; the constants are the vector of
`MotorData.coefficients`. Everything here accepts CasADi SX, MX or DM.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from services.codesign.motor_data import COEFFICIENTS, CONSTRAINTS, MU_0, MotorData

Expression = Any
"""A CasADi SX, MX or DM (CasADi ships no types)."""


class MotorParameters(NamedTuple):
    """What a design means to the circuit and to the arm (Table I, appendix). SI units."""

    phase_resistance: Expression  # R [ohm]
    inductance: Expression  # L_d = L_q [H]
    flux_linkage: Expression  # Phi_m [Wb]
    stator_mass: Expression  # [kg]
    rotor_mass: Expression  # [kg]
    stator_inertia_axial: Expression  # [kg m2], about the motor axis
    stator_inertia_transverse: Expression
    rotor_inertia_axial: Expression
    rotor_inertia_transverse: Expression
    slot_height: Expression  # h_ss [m]
    coil_area: Expression  # A_coil, copper of one turn [m2]
    tooth_flux: Expression  # k_w Phi_1, per turn and tooth [Wb]


def motor_parameters(design: Expression, coefficients: Expression) -> MotorParameters:
    """Map geometry to parameters  (appendix).

    Parameters
    ----------
    design
        Shape (7,), m, order of `DIMENSIONS`.
    coefficients
        Shape (17,), order of `COEFFICIENTS`.
    """
    L, R_ro, R_so, h_m, h_sy, w_tooth, b_0 = (design[k] for k in range(7))
    c = {name: coefficients[k] for k, name in enumerate(COEFFICIENTS)}
    Q, q_1, n_s = c["slots"], c["slots_per_phase"], c["turns_per_tooth"]
    C, h_tip, delta = c["parallel_coils"], c["tooth_tip_height"], c["air_gap"]
    mu_r, f_f = c["recoil_permeability"], c["filling_factor"]
    rho_iron, rho_cu, rho_e = c["iron_density"], c["copper_density"], c["copper_resistivity"]

    # Appendix, Dimensional specifications
    h_ss = R_so - h_sy - R_ro - delta - h_tip
    A_slot = math.pi * ((R_so - h_sy) ** 2 - (R_ro + delta + h_tip) ** 2) / Q - w_tooth * h_ss

    # Appendix, Stator and rotor weight
    A_cu = A_slot * f_f
    A_coil = A_cu / (2 * n_s)
    tau_s = 2 * math.pi * (R_ro + delta) / Q  # arc per slot; not a torque
    L_end_av = (w_tooth * (2 - math.pi / 2) + math.pi * tau_s / 2) / 2
    L_coil = 2 * L + 2 * L_end_av
    m_rotor = rho_iron * math.pi * R_ro**2 * L
    m_stator = rho_iron * math.pi * R_so**2 * L - m_rotor - rho_iron * A_cu * L * Q + rho_cu * A_coil * L_coil * n_s * Q

    # Appendix, Resistance. Departure 2 (docs/model.md): a slot holds two coil sides, so R_1 is twice as printed.
    R_1 = n_s * rho_e * L_coil / A_coil
    R = q_1 / C**2 * R_1

    # Appendix, Flux, with Carter's coefficient k_C
    gamma = (b_0 / delta) ** 2 / (5 + b_0 / delta)
    t_pitch = 2 * math.pi * R_ro / Q
    k_C = t_pitch / (t_pitch - gamma * delta)
    B_g = c["remanent_flux_density"] * (h_m / mu_r) / (h_m / mu_r + delta * k_C)
    B_g1 = 4 / math.pi * B_g * ca.sin(c["magnet_arc"] / 2)
    Phi_1 = B_g1 * c["flux_arc"] * R_ro * L
    tooth_flux = c["winding_factor"] * Phi_1
    Phi_m = q_1 / C * n_s * tooth_flux

    # Appendix, Permeance; appendix, Inductance
    p_g = t_pitch * MU_0 * L / (delta + h_m / mu_r)
    p_so = MU_0 * h_tip * L / b_0
    p_tt = MU_0 * L * 2 / math.pi  # the printed (delta + h_m) cancels
    L_dq = q_1 / C**2 * n_s**2 * (p_g + 3 * p_so + 3 * p_tt)

    return MotorParameters(
        phase_resistance=R,
        inductance=L_dq,
        flux_linkage=Phi_m,
        stator_mass=m_stator,
        rotor_mass=m_rotor,
        stator_inertia_axial=m_stator * (R_ro**2 + R_so**2) / 2,
        stator_inertia_transverse=m_stator * (3 * (R_ro**2 + R_so**2) + L**2) / 12,
        rotor_inertia_axial=m_rotor * R_ro**2 / 2,
        rotor_inertia_transverse=m_rotor * (3 * R_ro**2 + L**2) / 12,
        slot_height=h_ss,
        coil_area=A_coil,
        tooth_flux=tooth_flux,
    )


def design_constraints(design: Expression, coefficients: Expression) -> Expression:
    """Left-hand sides of (2b)-(2e) and (3c), shape (6,), order of `CONSTRAINTS`.

    Units: rad, mm, kg, mm2, T, T. The first, third, fifth and sixth have an upper limit, slot height and wire
    diameter a lower one; see `constraint_limits`.
    """
    motor = motor_parameters(design, coefficients)
    L, R_ro, h_sy, w_tooth, b_0 = design[0], design[1], design[4], design[5], design[6]
    delta = coefficients[COEFFICIENTS.index("air_gap")]
    k_p = coefficients[COEFFICIENTS.index("pitch_factor")]
    bore = 2 * (R_ro + delta)
    tooth_width = ca.asin(w_tooth / bore) + ca.asin(b_0 / bore)  # (2b)
    wire_diameter_squared = 4 * motor.coil_area / math.pi  # (2e). Departure 5 (docs/model.md): bare copper
    # (3c). Departure 3 (docs/model.md): flux per turn and tooth, not the flux linkage
    tooth_flux_density = k_p * motor.tooth_flux / (w_tooth * L)
    yoke_flux_density = k_p * motor.tooth_flux / (math.sqrt(3) * h_sy * L)
    return ca.vertcat(
        tooth_width,
        motor.slot_height * 1e3,  # (2c)
        motor.stator_mass + motor.rotor_mass,  # (2d)
        wire_diameter_squared * 1e6,
        tooth_flux_density,
        yoke_flux_density,
    )


def constraint_limits(data: MotorData) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper limits of `design_constraints`, each of shape (6,), infinite where there is none."""
    infinity = np.inf
    limits = {
        "tooth_width_rad": (-infinity, math.pi / data.slots),
        "slot_height_mm": (data.slot_height_min * 1e3, infinity),
        "mass_kg": (-infinity, data.mass_limit),
        "wire_diameter_squared_mm2": ((data.wire_diameter_min * 1e3) ** 2, infinity),
        "tooth_flux_density_T": (-infinity, data.flux_density_limit),
        "yoke_flux_density_T": (-infinity, data.flux_density_limit),
    }
    lower, upper = zip(*(limits[name] for name in CONSTRAINTS), strict=True)
    return np.array(lower), np.array(upper)


@lru_cache(maxsize=1)
def _numeric_model() -> ca.Function:
    design, coefficients = ca.SX.sym("design", 7), ca.SX.sym("coefficients", len(COEFFICIENTS))
    motor = motor_parameters(design, coefficients)
    return ca.Function("motor", [design, coefficients], [ca.vertcat(*motor), design_constraints(design, coefficients)])


def evaluate_motor(design: np.ndarray, data: MotorData) -> tuple[MotorParameters, dict[str, float]]:
    """Parameters and constraint values of one motor as floats.

    Parameters
    ----------
    design
        Shape (7,), m.
    """
    parameters, constraints = _numeric_model()(design, data.coefficients())
    values = [float(value) for value in parameters.full().ravel()]
    return MotorParameters(*values), dict(zip(CONSTRAINTS, constraints.full().ravel().tolist(), strict=True))


def evaluate_motors(designs: np.ndarray, data: MotorData) -> MotorParameters:
    """Parameters of several motors as arrays of shape (n,); `designs` has shape (n, 7) [m]."""
    parameters, _ = _numeric_model()(designs.T, data.coefficients())
    return MotorParameters(*parameters.full())


def steady_voltages(
    i_d: Expression, i_q: Expression, omega: Expression, motor: MotorParameters, pole_pairs: Expression
) -> tuple[Expression, Expression]:
    """Voltages [V] that hold the currents still: u = R i + rotational terms  (eq. 1, L_d = L_q).

    ``u_d = steady_d + L_d di_d/dt`` and ``u_q = steady_q + L_q di_q/dt``; `omega` is the rotor speed [rad/s].
    """
    R, L_d, Phi_m = motor.phase_resistance, motor.inductance, motor.flux_linkage
    steady_d = R * i_d - L_d * pole_pairs * omega * i_q
    steady_q = R * i_q + pole_pairs * omega * (L_d * i_d + Phi_m)
    return steady_d, steady_q


def motor_torque(i_q: Expression, motor: MotorParameters, pole_pairs: Expression) -> Expression:
    """Airgap torque [N m] = 3/2 P Phi_m i_q, which is what enters eq. (4) through the gear.

    Departure 4 (docs/model.md): with L_d = L_q no current in the d-axis makes torque.
    """
    return 1.5 * pole_pairs * motor.flux_linkage * i_q
