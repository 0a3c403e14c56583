"""Certificates as they are stored and sent, and the hash of what a result was computed from."""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any

import numpy as np

from services.codesign.accuracy import AccurateSolution, Round
from services.codesign.certify import BALANCE_TOLERANCE, Certificate, EnergyBalance
from services.codesign.problem import Accuracy, Transcription
from services.codesign.replay import Energies
from services.jobs.resolved import ResolvedApplication


def input_hash(
    application: ResolvedApplication, task: int, design: np.ndarray | None, gear_ratio: np.ndarray | None = None
) -> str:
    """SHA-256 of all that a motion depends on, in JSON with sorted keys and no spaces.

    Parameters
    ----------
    task
        Index of the task.
    design
        The design given, shape (n, 7) [m]; None when the task's own is sought.
    gear_ratio
        The design's, shape (n,), where gear ratios are free.
    """
    inputs = application.model_dump(mode="json", include={"robot", "objective", "motor", "transcription"})
    del inputs["objective"]["over_tasks"]  # it shapes designs, and a motion with a given design does not depend on it
    inputs |= {
        "task": application.tasks[task].model_dump(mode="json"),
        "design_m": None if design is None else design.tolist(),
    }
    if design is None and (freedom := application.design.model_dump(mode="json", exclude_defaults=True)):
        inputs["design"] = freedom
    if gear_ratio is not None:
        inputs["gear_ratio"] = gear_ratio.tolist()
    return hashlib.sha256(json.dumps(inputs, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def certificate_wire(
    certificate: Certificate, accuracy: Accuracy, transcription: Transcription, as_requested: bool
) -> dict[str, Any]:
    """Certificate with the tolerances it is judged by and the grid it belongs to.

    Parameters
    ----------
    as_requested
        Whether the transcription was asked for as it is, so that a missed tolerance is no failure.
    """
    return {
        "replay_position_rad": certificate.replay_position,
        "replay_speed_rad_s": certificate.replay_speed,
        "path_position_rad": certificate.path_position,
        "path_speed_rad_s": certificate.path_speed,
        "limit_violation": finite(certificate.limit_violation),
        "limits": {
            name: {"at_points": finite(check.at_points), "between_points": finite(check.between_points)}
            for name, check in certificate.limits.items()
        },
        "kkt_residual": finite(certificate.kkt_residual),
        "constraint_violation": finite(certificate.constraint_violation),
        "energy_balance": _balances(certificate),
        "tolerance": {"position_rad": accuracy.position, "speed_rad_s": accuracy.speed, "limit": accuracy.limit},
        "within_tolerance": certificate.meets(accuracy),
        "as_requested": as_requested,
        "scheme": transcription.scheme,
        "degree": transcription.degree,
        "intervals": transcription.intervals,
        "control": transcription.control,
    }


def refinement_wire(step: Round) -> dict[str, Any]:
    """One solve on the way to an accuracy."""
    return {
        "degree": step.transcription.degree,
        "intervals": step.transcription.intervals,
        "replay_position_rad": step.certificate.replay_position,
        "replay_speed_rad_s": step.certificate.replay_speed,
        "limit_violation": finite(step.certificate.limit_violation),
    }


def missed(found: AccurateSolution, accuracy: Accuracy) -> str:
    """Why a motion that was solved is no result, in words."""
    certificate, transcription = found.rounds[-1].certificate, found.rounds[-1].transcription
    grid = f"{transcription.intervals} intervals of degree {transcription.degree}"
    if certificate.replay_position is None or certificate.replay_speed is None:
        return f"the motion was solved on {grid}, but its voltages cannot be replayed to the end"
    if certificate.keeps(accuracy):
        return f"the motion was solved on {grid}, but the energies of its replay do not add up: {_open(certificate)}"
    return (
        f"the accuracy asked for was not reached on {grid}: the replay ends {certificate.replay_position:.2g} rad and "
        f"{certificate.replay_speed:.2g} rad/s off ({accuracy.position:g} rad and {accuracy.speed:g} rad/s allowed), "
        f"and exceeds a limit by {certificate.limit_violation:.2%} ({accuracy.limit:.2%} allowed)"
    )


def _open(certificate: Certificate) -> str:
    """The balances that are not closed, in words."""
    balances = {"electrical": certificate.electrical_balance, "mechanical": certificate.mechanical_balance}
    return " and ".join(
        f"{balance.residual:.2g} J of {balance.turned_over:.3g} J turned over are left in the {name} balance "
        f"({BALANCE_TOLERANCE:g} of it allowed)"
        for name, balance in balances.items()
        if balance is not None and not balance.closed
    )


def _balances(certificate: Certificate) -> dict[str, Any] | None:
    e, electrical, mechanical = certificate.energies, certificate.electrical_balance, certificate.mechanical_balance
    if e is None or electrical is None or mechanical is None:
        return None
    return {
        "electrical": {
            "input_J": e.electrical,
            "copper_J": e.copper,
            "field_change_J": e.field_change,
            "shaft_J": e.shaft,
            **_closure(electrical),
        },
        "mechanical": {
            "shaft_J": e.shaft,
            "kinetic_and_potential_change_J": e.mechanical_change,
            "friction_J": e.friction,
            **_closure(mechanical),
        },
    }


def _closure(balance: EnergyBalance) -> dict[str, Any]:
    return {"residual_J": balance.residual, "turned_over_J": balance.turned_over, "closed": balance.closed}


def energies_wire(energies: Energies) -> dict[str, Any]:
    """The energies of a motion's result, from the replay."""
    return {
        "energy_V2s": energies.effort,
        "electrical_energy_J": energies.electrical,
        "copper_loss_J": energies.copper,
        "recovered_energy_J": energies.recovered.tolist(),
    }


def finite(value: float) -> float | None:
    """NaN and infinity have no place in JSON."""
    return value if math.isfinite(value) else None
