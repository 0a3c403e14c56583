"""Equations as MathML, which browsers draw by themselves: nothing to load, and readable to a screen reader."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

SPAN = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Put MathML in place of TeX."""

    def drawn(match: re.Match[str]) -> str:
        _, bracket, tex = match.groups()
        return str(convert(html.unescape(tex).strip(), display="block" if bracket == "[" else "inline"))

    return SPAN.sub(drawn, content)
