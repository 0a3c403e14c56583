"""docs/operations.md says of settings and metrics what the code says, and names none that is not there."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import yaml

from shared.settings import Settings

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "docs" / "make_operations.py"
OF_CLIENTS = {"ARMATURE_URL", "ARMATURE_API_KEY", "ARMATURE_LOG_LEVEL"}
SUFFIXES = ("_bucket", "_sum", "_count")


def page() -> str:
    """The page as it is."""
    return (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")


def test_tables_are_those_of_the_code(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("make_operations", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert page() == module.written(tmp_path), "run: python docs/make_operations.py"


def test_every_setting_says_what_it_does() -> None:
    assert [name for name, field in Settings.model_fields.items() if not field.description] == []


def test_only_variables_that_exist_are_named() -> None:
    named = set(re.findall(r"ARMATURE_[A-Z_]+", page()))
    assert named <= {f"ARMATURE_{name.upper()}" for name in Settings.model_fields} | OF_CLIENTS


def test_alerts_ask_for_metrics_that_exist() -> None:
    (rules,) = re.findall(r"```yaml\n(groups:.*?)```", page(), flags=re.DOTALL)
    table = set(re.findall(r"^\| `(armature_\w+)`", page(), flags=re.MULTILINE))
    (group,) = yaml.safe_load(rules)["groups"]
    for rule in group["rules"]:
        for name in re.findall(r"armature_\w+", rule["expr"]):
            family = name if name in table else re.sub("|".join(f"{suffix}$" for suffix in SUFFIXES), "", name)
            assert family in table, f"{rule['alert']}: {name}"
