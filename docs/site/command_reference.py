"""The command line as a page, from the commands themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mkdocs.structure.files import File, Files


def on_files(files: Files, config: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, "cli.md", content="\n".join(page())))
    return files


def page() -> Iterator[str]:
    """Lines of Markdown."""
    import typer

    from armature.cli.commands import app
    from armature.cli.exit_codes import HELP

    yield "# Command line\n"
    yield "`armature --help` lists the commands, `armature COMMAND --help` says the same as this page.\n"
    yield HELP + "\n"
    yield from _commands(typer.main.get_command(app), "armature")


def _commands(group: Any, before: str) -> Iterator[str]:
    for name, command in group.commands.items():
        if getattr(command, "commands", None):
            yield from _commands(command, f"{before} {name}")
            continue
        yield f"\n## {before} {name}\n"
        yield (command.help or "").replace("\b", "") + "\n"
        rows = [row for parameter in command.params if (row := _row(parameter))]
        if rows:
            yield "| | | default |\n|---|---|---|"
            yield from rows


def _row(parameter: Any) -> str | None:
    if getattr(parameter, "hidden", False) or parameter.name == "help":
        return None
    option = parameter.param_type_name == "option"
    name = ", ".join(parameter.opts) if option else (parameter.metavar or parameter.name or "").upper()
    value = parameter.default if isinstance(parameter.default, str | int | float | bool) else ""
    default = "needed" if parameter.required else f"`{value}`" if value not in ("", False, None) else ""
    words = (getattr(parameter, "help", "") or "").replace("|", "\\|").replace("\n", " ")
    return f"| `{name}` | {words} | {default} |"
