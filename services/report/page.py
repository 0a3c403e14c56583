"""The report on an application: one HTML file that needs nothing else."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from services.codesign.comparison import OWN
from services.report.answers import Answers
from services.report.figures import figures_of
from services.report.html_table import number, percent
from services.report.inline_svg import inline_svg
from services.report.report_tables import (
    certificate_table,
    constants_table,
    dimension_table,
    limit_tables,
    missed_tolerance,
    motions_of,
    result_table,
    robot_table,
    starts_table,
    task_table,
    totals_table,
    version_table,
)
from services.report.style import method_name, style
from services.report.words import METHODS, limit_words, objective_words
from shared.contracts.comparisons import DesignAnswer

_CAPTIONS = {
    "motors": "The design: every motor cut across and along its axis, to one scale, with its dimensions.",
    "designs": "The tasks' own designs, motor by motor, with the design that was chosen.",
    "convergence": "How the best single design was found: the program's objective, iteration by iteration.",
    "totals": "Methods side by side, and their regret against the tasks' own designs.",
    "improvement": "How much the chosen method improves on the others, task by task.",
    "motion": "One motion: every joint over time, against its limits.",
}


@dataclass(frozen=True)
class PlacedFigure:
    """A figure with its caption."""

    svg: Markup
    caption: str


@dataclass(frozen=True)
class Report:
    """What a report is made from."""

    answers: Answers
    tasks: Sequence[Mapping[str, Any]]  # as they were understood, every default filled in
    request: Mapping[str, Any]  # gives the same results again when it is submitted


def report_page(report: Report) -> str:
    """The page, figures and style inside it; it has no script and asks for nothing."""
    answers, status = report.answers, report.answers.application
    page = _ENVIRONMENT.get_template("report.html").render(
        status=status,
        objective=objective_words(status.objective),
        methods=[(method_name(name), METHODS[name]) for name in (OWN, *status.methods)],
        facts=list(_facts(answers)),
        figures=_figures(answers),
        robot=None if answers.robot is None else robot_table(answers.robot),
        constants=constants_table(answers.motor),
        tasks=task_table(report.tasks),
        dimensions=None if answers.design is None else dimension_table(answers.design),
        binding=[] if answers.design is None else _binding(answers.design),
        totals=None if answers.comparison is None else totals_table(answers.comparison),
        limits=[] if answers.comparison is None else limit_tables(answers.comparison, status.method),
        missing={} if answers.comparison is None else answers.comparison.missing,
        results=result_table(answers.tasks, status.methods, status.objective.kind),
        failed=[task for task in answers.tasks.items if task.reason],
        starts=starts_table(answers.tasks),
        certificates=certificate_table(answers.tasks),
        missed=missed_tolerance(answers.tasks),
        versions=version_table(status.versions),
        request_hash=request_hash(report.request),
        request_yaml=yaml.safe_dump(dict(report.request), sort_keys=False, allow_unicode=True, width=110),
    )
    return page + "\n"


def request_hash(request: Mapping[str, Any]) -> str:
    """SHA-256 of a request, in JSON with sorted keys and no spaces."""
    return hashlib.sha256(json.dumps(request, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _facts(answers: Answers) -> Iterator[tuple[str, str]]:
    """What a reader wants to know first."""
    status, comparison = answers.application, answers.comparison
    yield "state", status.state.replace("_", " ")
    solved = sum(task.own is not None for task in answers.tasks.items)
    yield "tasks solved", f"{solved} of {len(answers.tasks.items)}"
    if comparison is not None and status.method in comparison.methods:
        total = comparison.methods[status.method].total_objective
        unit = "" if comparison.unit == "1" else f" {comparison.unit.replace('V2', 'V²')}"
        yield f"total with the {method_name(status.method)} design", f"{number(total, 5)}{unit}"
        regret = comparison.regret.get(status.method)
        if regret is not None and regret.total is not None:
            yield "regret", f"{percent(regret.total)} %"
    kept = Counter(motion.certificate.within_tolerance for _, _, motion in motions_of(answers.tasks))
    if kept:
        yield "motions that keep their tolerance", f"{kept[True]} of {kept.total()}"
    times = status.timings
    if times.wall_time_s is not None:
        yield "time taken", f"{number(times.wall_time_s, 3)} s, {number(times.solver_time_s, 3)} s of solving"


def _binding(design: DesignAnswer) -> list[tuple[str, str]]:
    """What holds each motor at its dimensions, motors alike together."""
    alike: dict[str, list[str]] = {}
    for sheet in design.motors:
        words = "; ".join(limit_words(name, sheet["constraints"][name]) for name in sheet["binding"])
        alike.setdefault(words or "nothing", []).append(str(sheet["joint"]))
    return [(", ".join(joints), words) for words, joints in alike.items()]


def _figures(answers: Answers) -> dict[str, PlacedFigure]:
    """By what they show; of motions the first."""
    placed: dict[str, PlacedFigure] = {}
    for name, draw in figures_of(answers):
        kind = name.partition("-")[0]
        if kind in placed:
            continue
        with style():
            figure = draw()
        placed[kind] = PlacedFigure(inline_svg(figure, kind, _CAPTIONS[kind]), _CAPTIONS[kind])
    return placed


_ENVIRONMENT = Environment(
    loader=PackageLoader("services.report"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
