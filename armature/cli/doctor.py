"""`armature doctor`: whether this machine and its settings can run the service."""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic import BaseModel

from armature.cli.consoles import messages, output, print_json
from armature.cli.exit_codes import ExitCode
from armature.doctor.finding import Finding, Level

COLOURS = {Level.OK: "green", Level.WARN: "yellow", Level.FAIL: "bold red"}


class Examination(BaseModel):
    """All findings."""

    healthy: bool
    findings: list[Finding]


def doctor(
    quick: Annotated[bool, typer.Option("--quick", help="Leave out the test solve.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Look at compiler, database, broker, cores, memory and disk, solve one task whose answer is known, and say what
    to do.

    Exit code 0: the service can run, whatever the warnings; 1: it cannot.
    """
    from armature.doctor.examine import examine, healthy  # slow to import: it brings the database's library
    from shared.settings import Settings

    findings = []
    with messages().status("looking; kernels that are missing are compiled, once") as status:
        for finding in examine(Settings(), with_solve=not quick):
            findings.append(finding)
            if not as_json:
                status.stop()
                _say(finding)
                status.start()
    well = healthy(findings)
    if as_json:
        print_json(Examination(healthy=well, findings=findings))
    raise typer.Exit(ExitCode.OK if well else ExitCode.ERROR)


def _say(finding: Finding) -> None:
    line = f"{finding.level.value:<4}  {finding.subject:<10}  {finding.found}"
    output().print(line, style=COLOURS[finding.level], soft_wrap=True)
    if finding.advice:
        output().print(f"      {'':<10}  {finding.advice}", soft_wrap=True)
