"""What a report says of methods, objectives and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from services.report.html_table import number
from services.report.style import DIMENSION_NAMES
from shared.contracts.application import ObjectiveRequest

METHODS: Final[Mapping[str, str]] = {
    "own": "every task with motors of its own: a bound that no single design can beat",
    "two_step": "the mean of the tasks' own designs, projected onto the motors that can be built: the paper's",
    "empirical": "one typical task's own design, for all tasks",
    "worst_case": "the hardest task's own design, for all tasks",
    "catalogue": "the design moved to sizes that can be had: a catalogue's motors, or lengths in steps",
    "shared_optimum": "the best single design for all tasks: all motions and one design in one program",
}

OBJECTIVES: Final[Mapping[str, str]] = {
    "time": "shortest time [s]",
    "energy": "least energy ∫u'u dt [V² s] over a given time",
    "electrical_energy": "least electrical energy [J] over a given time, what is given back counted",
}

QUANTITIES: Final[Mapping[str, str]] = {
    "time": "final time\ns",
    "energy": "energy\nV² s",
    "weighted": "weighted objective\n1",
    "electrical_energy": "electrical energy\nJ",
}

LIMITS: Final[Mapping[str, str]] = {
    "tooth_width": "tooth and slot opening fill the pitch",
    "slot_height": "height of the slots",
    "mass": "mass",
    "wire_diameter": "diameter of the wire",
    "tooth_flux_density": "flux density in the teeth",
    "yoke_flux_density": "flux density in the yoke",
}


def objective_words(objective: ObjectiveRequest) -> str:
    """What is minimised."""
    if objective.kind == "weighted":
        alpha = objective.alpha or 0.0
        return f"weighted sum, {number(alpha)} energy and {number(1 - alpha)} time"
    return OBJECTIVES[objective.kind]


def limit_words(name: str, entry: Mapping[str, Any]) -> str:
    """A limit that binds, with its value."""
    value = f"{number(entry['limit'])} {entry['unit']}"
    for end, words in (("_min", "at least"), ("_max", "at most")):
        if name.endswith(end):
            return f"{DIMENSION_NAMES[name.removesuffix(end)]} {words} {value}"
    return f"{LIMITS.get(name, name.replace('_', ' '))}: {value}"
