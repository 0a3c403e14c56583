"""Draw the time-energy front of docs/sweeps.md, and print its numbers, from a stored sweep.

1. armature sweep run examples/time_energy_front.yaml
2. python docs/make_front.py out/time-against-energy-ID
"""

from __future__ import annotations

import sys
from pathlib import Path

from services.report.front_chart import front_chart
from services.report.style import save, style
from shared.contracts.sweeps import SweepStatus

IMAGE = Path(__file__).parent / "images" / "time-energy-front.png"


def main(folder: Path) -> None:
    """Write the image and print the sweep's totals as a table."""
    sweep = SweepStatus.model_validate_json((folder / "sweep.json").read_bytes())
    with style():
        save(front_chart(sweep), IMAGE)
    print(f"{IMAGE.name}: {IMAGE.stat().st_size / 1000:.0f} kB")
    print("| alpha | total time, s | total energy, V² s | electrical energy, J |\n|---|---|---|---|")
    for point in sweep.points:
        if (totals := point.totals.get(point.method)) is not None:
            numbers = f"{totals.time_s:.3f} | {totals.energy_V2s:.0f} | {totals.electrical_energy_J:.1f}"
            print(f"| {point.values['objective.alpha']:g} | {numbers} |")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]))
