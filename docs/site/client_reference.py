"""The Python client as a page, from its docstrings and signatures."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

from mkdocs.structure.files import File, Files

SECTION = re.compile(r"^(\w[\w ]*)\n-+$", re.MULTILINE)


def on_files(files: Files, config: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, "client.md", content="\n".join(page())))
    return files


def page() -> Iterator[str]:
    """Lines of Markdown: every public name of the package."""
    import armature

    yield "# Python client\n"
    yield from _words(armature)
    for name in armature.__all__:
        thing = getattr(armature, name)
        if not inspect.isclass(thing):
            continue
        yield f"\n## {name}\n"
        yield from _words(thing)
        for method, function in vars(thing).items():
            if not method.startswith("_") and inspect.isfunction(function):
                yield f"\n### {name}.{method}\n"
                yield f"`{method}{_signature(function)}`\n"
                yield from _words(function)


def _signature(function: Any) -> str:
    return str(inspect.signature(function)).replace("self, ", "").replace("(self)", "()").replace("'", "")


def _words(thing: Any) -> Iterator[str]:
    """A docstring, its sections' titles bold."""
    words = inspect.getdoc(thing) or ""
    yield SECTION.sub(r"\n**\1**\n", words).replace("``", "`") + "\n"
