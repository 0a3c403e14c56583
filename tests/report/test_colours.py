"""Better and worse are told apart with every common colour vision."""

from __future__ import annotations

import numpy as np
import pytest

from services.report.style import IMPROVEMENT

VISION = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""On linear RGB: Machado, Oliveira and Fernandes 2009, severity 1."""

SRGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])  # D65

APART = 20.0
"""Distance in CIE Lab; 2.3 is just noticeable, and 20 is seen at a glance."""


def lab(rgb: tuple[float, ...], vision: np.ndarray) -> np.ndarray:
    """sRGB -> CIE Lab of the colour that is seen."""
    colour = np.array(rgb[:3])
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(np.maximum(SRGB_TO_XYZ @ np.clip(vision @ linear, 0, 1) / WHITE, 0.008856))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("percent", [5.0, 10.0, 20.0])
def test_better_and_worse_look_different(vision: str, percent: float) -> None:
    """At the same distance from zero on both sides, of a scale that ends at 20 percent."""
    matrix = np.array(VISION[vision])
    worse, better = (lab(IMPROVEMENT(0.5 + side * percent / 40), matrix) for side in (-1, 1))
    assert np.linalg.norm(better - worse) > APART
