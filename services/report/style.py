"""How every figure looks: fonts, lines, colours, names; and how it is saved, the same bytes each time."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, TextIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

Format = Literal["svg", "png", "pdf"]

INK: Final = "#222222"
"""Text and outlines."""
QUIET: Final = "#6b6b6b"
"""Secondary text, axes."""
FAINT: Final = "#d9d9d9"
"""Grid lines."""
OUTSIDE: Final = "#f1f1f1"
"""Where nothing may be: beyond a bound or a limit."""

RED, BLUE, ORANGE, PURPLE = "#c8361d", "#0072b2", "#d98200", "#8f4a8b"
"""After Okabe and Ito, darkened for lines on white; told apart with every common colour vision."""

CHOSEN: Final = BLUE
"""The application's method among others. Not green: it need not be the better one."""

OBJECTIVE_COLOURS: Final[Mapping[str, str]] = {
    "time": RED,
    "energy": BLUE,
    "weighted": PURPLE,
    "electrical_energy": BLUE,
}
"""The paper's: time-optimal red, energy-optimal blue."""

IMPROVEMENT: Final = LinearSegmentedColormap.from_list(
    "improvement", ["#a0105e", "#e79ac4", "#fbfbf8", "#a3cc6a", "#3d7a12"]
)
"""Worse (red) to better (green). The red leans to blue and the green to yellow, which colour blindness leaves apart;
the sign of the number says it without colour."""

METHOD_NAMES: Final[Mapping[str, str]] = {
    "own": "own design per task",
    "two_step": "two-step",
    "empirical": "empirical",
    "worst_case": "worst case",
    "shared_optimum": "shared optimum",
    "catalogue": "catalogue",
}

DIMENSION_NAMES: Final[Mapping[str, str]] = {
    "L": "stack length",
    "R_ro": "rotor outer radius",
    "R_so": "stator outer radius",
    "h_m": "magnet height",
    "h_sy": "stator yoke height",
    "w_tooth": "tooth width",
    "b_0": "slot opening",
}

DIMENSION_SYMBOLS: Final[Mapping[str, str]] = {
    "L": "$L$",
    "R_ro": "$R_{ro}$",
    "R_so": "$R_{so}$",
    "h_m": "$h_m$",
    "h_sy": "$h_{sy}$",
    "w_tooth": "$w_{tooth}$",
    "b_0": "$b_0$",
}

_SETTINGS: Final[dict[Any, Any]] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same text width everywhere
    "mathtext.fontset": "dejavusans",
    "font.size": 9,
    "text.color": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.labelcolor": INK,
    "axes.edgecolor": QUIET,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "figure.facecolor": "white",  # opaque: readable on dark pages too
    "savefig.facecolor": "white",
    "savefig.transparent": False,
    "svg.hashsalt": "armature",  # the same element ids each time
    "svg.fonttype": "path",  # no fonts needed where it is shown
    "pdf.fonttype": 42,  # TrueType, which journals take
}

_NO_TIMESTAMP: Final[Mapping[Format, Mapping[str, None]]] = {
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

PNG_DOTS_PER_INCH: Final = 130


def style() -> Any:
    """Context in which figures are drawn and saved: matplotlib's defaults, then this project's settings."""
    return mpl.rc_context({**mpl.rcParamsDefault, **_SETTINGS, "backend": "agg"})


def new_figure(width: float, height: float) -> Figure:
    """An empty figure that lays itself out; width and height in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def save(figure: Figure, path: Path) -> Path:
    """Write as SVG, PNG or PDF, as the name ends; the same figure gives the same bytes."""
    kind: Format = {".svg": "svg", ".pdf": "pdf"}.get(path.suffix, "png")  # type: ignore[assignment]
    _write(figure, path, kind)
    return path


def svg_text(figure: Figure) -> str:
    """The figure as an SVG document."""
    written = io.StringIO()
    _write(figure, written, "svg")
    return written.getvalue()


def _write(figure: Figure, to: Path | TextIO, kind: Format) -> None:
    with style():
        _lay_out(figure)
        figure.savefig(to, format=kind, metadata=dict(_NO_TIMESTAMP[kind]), dpi=PNG_DOTS_PER_INCH)


def _lay_out(figure: Figure) -> None:
    """Place everything, once. `savefig` would draw the whole figure once more for it, and throw the drawing away."""
    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


def light_grid(axes: Axes, axis: Literal["x", "y", "both"] = "y") -> None:
    """Faint lines to read values by."""
    axes.grid(visible=True, axis=axis)


def shade_outside(axes: Axes, low: float, high: float) -> None:
    """Grey what lies beyond [low, high] on the y axis, within the present view, and draw both bounds."""
    bottom, top = axes.get_ylim()
    for edge, end in ((low, bottom), (high, top)):
        if min(bottom, top) <= edge <= max(bottom, top):
            axes.axhspan(edge, end, color=OUTSIDE, linewidth=0, zorder=0)
            axes.axhline(edge, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
    axes.set_ylim(bottom, top)


def method_name(method: str) -> str:
    """As people read it."""
    return METHOD_NAMES.get(method, method.replace("_", " "))
