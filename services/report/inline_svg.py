"""Figures as SVG inside a page."""

from __future__ import annotations

import re
from typing import Any, Final

from markupsafe import Markup, escape
from matplotlib.figure import Figure

from services.report.style import svg_text

_HEAD: Final = re.compile(r"^.*?(?=<svg)", re.S)
_METADATA: Final = re.compile(r"<metadata>.*?</metadata>\s*", re.S)
_IDS: Final = re.compile(r'(\bid="|url\(#|href="#)')
_SIZE: Final = re.compile(r'<svg[^>]*?\bwidth="([\d.]+)pt"[^>]*>', re.S)


def inline_svg(figure: Figure, name: str, label: str) -> Markup:
    """A figure as an element of a page, as wide as it was drawn and no wider than the page.

    Parameters
    ----------
    name
        Unlike any other figure's of the page: element ids get it in front.
    label
        What the figure shows, for those who cannot see it.
    """
    text = _METADATA.sub("", _HEAD.sub("", svg_text(figure)))
    text = _IDS.sub(lambda match: f"{match[1]}{name}-", text)
    found: Any = _SIZE.search(text)
    opening = re.sub(r'\s(?:width|height)="[\d.]+pt"', "", found[0])
    described = f'{opening[:-1]} role="img" aria-label="{escape(label)}" style="width: {float(found[1]):.0f}pt">'
    return Markup(text.replace(found[0], described, 1))
