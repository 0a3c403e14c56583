"""Robots: what there is, what a file holds and what looks wrong in it, and uploads: `armature robot ...`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armature.application_file import read_robot
from armature.cli.completion import robot_ids
from armature.cli.consoles import messages, output, print_deleted, print_json
from armature.cli.exit_codes import ExitCode
from armature.cli.layout import new_table, print_table
from armature.cli.server import Json, Url, ask
from armature.client import DEFAULT_URL
from armature.errors import ApplicationFileError

if TYPE_CHECKING:
    from services.codesign.robot import Robot

app = typer.Typer(help="Robots: presets, files, uploads.", no_args_is_help=True)

DRAWINGS = (".svg", ".pdf", ".png")


@app.command("list")
def list_all(url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Presets and uploaded robots of a server."""
    with ask(url) as client:
        found = client.robots()
    if as_json:
        print_json(found)
        return
    table = new_table("id", "name", "kind", "description", left=4)
    for robot in found:
        table.add_row(robot["id"], robot["name"], robot["kind"], robot["description"])
    output().print(table)


@app.command()
def show(
    robot: Annotated[str, typer.Argument(metavar="ID|PRESET", show_default=False, autocompletion=robot_ids)],
    url: Url = DEFAULT_URL,
    _as_json: Annotated[bool, typer.Option("--json", help="As without: it is always JSON.")] = True,
) -> None:
    """A robot of a server in the robot format, a JSON that can be edited and uploaded."""
    with ask(url) as client:
        print_json(client.robot(robot))


@app.command()
def upload(
    file: Annotated[Path, typer.Argument(help="The robot format, or a URDF's settings in YAML.", show_default=False)],
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Keep a robot on a server and print its id, to be named in applications."""
    with ask(url) as client:
        robot = client.upload_robot(file)
    if as_json:
        print_json({"id": robot, "url": f"/v1/robots/{robot}"})
    else:
        output().print(robot)


@app.command()
def delete(
    robot: Annotated[str, typer.Argument(metavar="ID", show_default=False, autocompletion=robot_ids)],
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Forget an uploaded robot; applications that use it keep their copy."""
    with ask(url) as client:
        client.delete_robot(robot)
    print_deleted(robot, as_json)


@app.command()
def check(
    robot: Annotated[str, typer.Argument(metavar="FILE|PRESET", show_default=False)],
    draw: Annotated[Path | None, typer.Option(help="Draw the arm into this file, .svg, .pdf or .png.")] = None,
    as_json: Json = False,
) -> None:
    """Show an arm, and list what looks wrong in it. Nothing is sent anywhere.

    Exit code 0: nothing looks wrong; 1: something does; 3: it is no arm.
    """
    from services.codesign.robot import preset_names, preset_wire
    from services.jobs.inline_robot import inline_robot
    from services.jobs.inline_robot import read_robot as robot_of
    from services.robots.check import check_robot
    from shared.contracts.errors import InvalidInputError

    if draw is not None and draw.suffix not in DRAWINGS:
        raise typer.BadParameter(f"--draw: {draw} ends neither in {' nor in '.join(DRAWINGS)}")
    preset = robot in preset_names() and not Path(robot).exists()
    if not preset and not Path(robot).exists():
        presets = ", ".join(preset_names())
        raise ApplicationFileError(f"there is no file {robot}, and no preset of that name; presets are {presets}")
    given: Mapping[str, Any] = preset_wire(robot) if preset else read_robot(Path(robot))
    try:
        arm = robot_of(inline_robot(given))
    except InvalidInputError as error:
        for problem in error.errors:
            messages().print(problem.message, style="bold red", soft_wrap=True)
        raise typer.Exit(ExitCode.REFUSED) from error
    findings = check_robot(arm)
    if draw is not None:
        _draw(arm, draw)
    if as_json:
        print_json([asdict(finding) for finding in findings])
    else:
        _print_arm(arm)
        for finding in findings:
            line = f"{finding.where}: {finding.what}: {finding.value} ({finding.limit})"
            output().print(line, style="yellow", soft_wrap=True)
        output().print(f"{len(findings)} to look at" if findings else "nothing looks wrong")
    raise typer.Exit(ExitCode.ERROR if findings else ExitCode.OK)


def _print_arm(arm: Robot) -> None:
    from services.robots.check import gyration_radii, link_lengths, reach

    columns = ("gear", "range\nrad", "speed\nrad/s", "mass\nkg", "length\nm", "gyration\nm", "friction\nNm s/rad, Nm")
    table = new_table("joint", *columns)
    rows = zip(link_lengths(arm), gyration_radii(arm), arm.joint_speed_limit, strict=True)
    for k, (length, radius, speed) in enumerate(rows):
        table.add_row(
            str(k + 1),
            f"{arm.gear_ratio[k]:g}",
            f"{arm.joint_lower[k]:.2f} .. {arm.joint_upper[k]:.2f}",
            f"{speed:.2f}",
            f"{arm.link_mass[k]:.3f}",
            f"{length:.3f}",
            f"{radius:.3f}",
            f"{arm.viscous_friction[k]:.3g}, {arm.coulomb_friction[k]:.3g}",
        )
    joints = "1 joint" if arm.joints == 1 else f"{arm.joints} joints"
    total = f"{arm.name}: {joints}, reach {reach(arm):.3f} m, {arm.link_mass.sum():.2f} kg without motors"
    print_table(output(), total, table)


def _draw(arm: Robot, path: Path) -> None:
    from services.report.arm_drawing import arm_drawing
    from services.report.style import save, style

    with style():
        save(arm_drawing(arm), path)
