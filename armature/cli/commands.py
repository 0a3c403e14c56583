"""The commands of `armature`, put together."""

from __future__ import annotations

from typing import Annotated

import typer

from armature.cli import doctor, export, local, motions, operator, remote, report, robots, sweeps
from armature.cli.exit_codes import HELP
from armature.cli.failures import Commands
from armature.cli.version import print_version

app = typer.Typer(
    cls=Commands,
    epilog=HELP,
    context_settings={"help_option_names": ["--help", "-h"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

HERE, SERVER = "On this machine", "Any server (--url or ARMATURE_URL)"
OPERATOR = "For the operator (ARMATURE_DATABASE_URL)"


@app.callback()
def armature(
    version: Annotated[
        bool, typer.Option("--version", callback=print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Co-design of robot-arm motors and motions."""


app.command(rich_help_panel=HERE)(local.run)
app.command(rich_help_panel=HERE)(local.up)
app.command(rich_help_panel=HERE)(doctor.doctor)
app.command("list", rich_help_panel=SERVER)(remote.list_applications)
app.add_typer(robots.app, name="robot", rich_help_panel=SERVER)
app.add_typer(sweeps.app, name="sweep", rich_help_panel=SERVER)
app.command(rich_help_panel=OPERATOR)(operator.migrate)
app.add_typer(operator.app, name="key", rich_help_panel=OPERATOR)
for command in (
    remote.submit,
    remote.status,
    remote.watch,
    remote.tasks,
    remote.design,
    remote.designs,
    remote.comparison,
    remote.cancel,
    remote.stop_search,
    remote.retry,
    remote.delete,
    motions.trajectory,
    motions.log,
    export.export,
    report.report,
):
    app.command(rich_help_panel=SERVER)(command)
