"""Pages that live elsewhere in the repository, and files that pages link to.

A link that leads out of docs/ is followed: a page of Markdown becomes a page of the site, any other file a download,
and a folder just words.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
PAGES = {
    "index.md": "README.md",
    "CHANGELOG.md": "CHANGELOG.md",
    "CONTRIBUTING.md": "CONTRIBUTING.md",
    "services/codesign/README.md": "services/codesign/README.md",
}
"""Place on the site -> place in the repository."""

LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
FENCE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)


def on_files(files: Files, config: Any) -> Files:
    """Add what lives elsewhere."""
    for place, source in PAGES.items():
        files.append(File.generated(config, place, content=(ROOT / source).read_text(encoding="utf-8")))
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    files.append(File.generated(config, "LICENSE.md", content=f"# Licence\n\n```text\n{licence}\n```\n"))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    words = "# Citing\n\n`CITATION.cff`, which reference managers read:\n\n"
    files.append(
        File.generated(
            config, "citing.md", content=f"{words}```yaml\n# not run: for reference managers\n{citation}```\n"
        )
    )
    for page in [file for file in files if file.src_uri.endswith(".md")]:
        for target in _outside(_source_of(page.src_uri), page.content_string):
            if files.get_file_from_path(f"files/{target}") is None:
                files.append(File.generated(config, f"files/{target}", content=(ROOT / target).read_bytes()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead links to where their targets are on the site."""
    here, source = page.file.src_uri, _source_of(page.file.src_uri)

    def lead(match: re.Match[str]) -> str:
        bang, words, link = match.groups()
        target, path = _target(source, link)
        if target is None:
            return match.group()
        if (ROOT / target).is_dir() or not (ROOT / target).exists():
            return words if (ROOT / target).is_dir() else match.group()
        relative = posixpath.relpath(_place(target), posixpath.dirname(here) or ".")
        return f"{bang}[{words}]({relative}{path})"

    parts = FENCE.split(markdown)
    return "".join(part if k % 2 else LINK.sub(lead, part) for k, part in enumerate(parts))


def _source_of(place: str) -> str:
    """Where a page of the site is in the repository."""
    return PAGES.get(place, f"docs/{place}")


def _place(target: str) -> str:
    """Where a file of the repository is on the site."""
    known = {source: place for place, source in PAGES.items()} | {"LICENSE": "LICENSE.md"}
    if target in known:
        return known[target]
    return target.removeprefix("docs/") if target.startswith("docs/") else f"files/{target}"


def _target(source: str, link: str) -> tuple[str | None, str]:
    """The file in the repository that a link means, and its anchor; None for addresses and anchors alone."""
    path, hash_, anchor = link.partition("#")
    if not path or "://" in path or path.startswith("mailto:"):
        return None, ""
    return posixpath.normpath(posixpath.join(posixpath.dirname(source), path)), hash_ + anchor


def _outside(source: str, markdown: str) -> set[str]:
    """Files that a page links to and that are no pages of the site."""
    prose = "".join(FENCE.split(markdown)[::2])
    targets = (_target(source, link)[0] for _, _, link in LINK.findall(prose))
    return {
        target for target in targets if target and (ROOT / target).is_file() and _place(target).startswith("files/")
    }
