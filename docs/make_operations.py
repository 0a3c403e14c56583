"""Write the tables of settings and metrics into docs/operations.md: `python docs/make_operations.py`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from fastapi.testclient import TestClient
from prometheus_client.metrics_core import Metric
from prometheus_client.parser import text_string_to_metric_families
from pydantic.fields import FieldInfo

from api.app import create_app
from shared.settings import Settings

PAGE = Path(__file__).parent / "operations.md"

UNITS = {"_s": "s", "_days": "days", "_hours": "hours", "_bytes": "bytes", "_mb": "MB", "_per_minute": "1/min"}
"""By the end of a setting's name."""
DEFAULTS = {
    "home": "`~/.armature`",
    "database_url": "`armature.db` in the home folder",
    "broker_url": "`broker` in the home folder",
    "workers": "processors",
    "shared_threads": "processors",
}
"""Of settings whose default depends on the machine."""


def settings_table() -> str:
    """Every setting: variable, default with its unit, what it does."""
    rows = [
        f"| `ARMATURE_{name.upper()}` | {_default(name, field)} | {_one_line(field.description or '')} |"
        for name, field in Settings.model_fields.items()
    ]
    return "\n".join(["| variable | default | what it does |", "| --- | --- | --- |", *rows])


def _default(name: str, field: FieldInfo) -> str:
    if name in DEFAULTS:
        return DEFAULTS[name]
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
    value = str(field.default).lower() if isinstance(field.default, bool) else f"{field.default:,}"
    return f"{value.removesuffix('.0')} {unit}".strip()


def metrics_table(home: Path) -> str:
    """Every metric that the API serves: name, labels, what it counts."""
    rows = [
        f"| `{_series(family)}` | {family.type} | {_labels(family)} | {family.documentation} |"
        for family in _families(home)
    ]
    return "\n".join(["| name | kind | labels | what it is |", "| --- | --- | --- | --- |", *sorted(rows)])


def _families(home: Path) -> Iterator[Metric]:
    settings = Settings(home=home, database_url=f"sqlite:///{home / 'armature.db'}", broker_url=f"embedded://{home}/b")
    from shared.db.migrate import upgrade

    upgrade(settings.database_url)
    with TestClient(create_app(settings)) as client:
        client.get("/livez")  # requests are counted from the first on
        families = list(text_string_to_metric_families(client.get("/metrics").text))
    return (family for family in families if family.name.startswith("armature_") and not _is_creation_time(family))


def _is_creation_time(family: Metric) -> bool:
    return family.name.endswith("_created")


def _series(family: Metric) -> str:
    return f"{family.name}_total" if family.type == "counter" else family.name


def _labels(family: Metric) -> str:
    names = {name for sample in family.samples for name in sample.labels} - {"le"}
    return ", ".join(f"`{name}`" for name in sorted(names))


def _one_line(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def with_section(page: str, section: str, text: str) -> str:
    """A page whose section between markers is this text."""
    marked = rf"(<!-- {section} -->).*?(<!-- /{section} -->)"
    return re.sub(marked, lambda found: f"{found[1]}\n\n{text}\n\n{found[2]}", page, flags=re.DOTALL)


def written(home: Path) -> str:
    """The page as it should be; `home`: an empty folder."""
    page = with_section(PAGE.read_text(encoding="utf-8"), "settings", settings_table())
    return with_section(page, "metrics", metrics_table(home))


def main() -> None:
    """Write the page."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        PAGE.write_text(written(Path(folder)), encoding="utf-8")


if __name__ == "__main__":
    main()
