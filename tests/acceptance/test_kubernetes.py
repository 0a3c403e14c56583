"""deploy/kubernetes cannot drift: it is held against the Compose file, the Dockerfile, the settings and the API.

There is no cluster here. The commands are those of docker-compose.yml, which `test_compose` runs; the scaler's question
is asked of a real Postgres.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psycopg
import pytest
import yaml

from api.app import create_app
from services.jobs.claim import claim
from services.jobs.submit import submit
from shared.db.engine import make_engine
from shared.db.migrate import upgrade
from shared.settings import Settings
from tests.acceptance.test_compose import SERVICES
from tests.servers import Server, postgres_database
from tests.service.queue_actions import LONG_LEASE_S, drain, queued
from tests.service.requests import application
from worker.main import GOODBYE_S
from worker.run_job import GIVING_BACK_S

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "deploy" / "kubernetes"
MANIFESTS: list[dict[str, Any]] = [
    manifest
    for path in sorted(FOLDER.glob("*.yaml"))
    if path.name != "kustomization.yaml"
    for manifest in yaml.safe_load_all(path.read_text(encoding="utf-8"))
]
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
OURS = ("migrate", "api", "relay", "worker")
SECRET = "armature"
WRITTEN = {"/var/lib/armature", "/tmp"}
"""All that may be written to: the image's ARMATURE_HOME, and what compilers need."""


def named(kind: str, name: str) -> dict[str, Any]:
    """The one of a kind and name."""
    (found,) = (each for each in MANIFESTS if each["kind"] == kind and each["metadata"]["name"] == name)
    return found


def pod(role: str) -> dict[str, Any]:
    """A role's pod template."""
    template: dict[str, Any] = named("Job" if role == "migrate" else "Deployment", f"armature-{role}")["spec"][
        "template"
    ]
    return template


def container(role: str) -> dict[str, Any]:
    """The one container of a role's pod."""
    (only,) = pod(role)["spec"]["containers"]
    return dict(only)


def test_every_file_is_applied() -> None:
    kustomization = yaml.safe_load((FOLDER / "kustomization.yaml").read_text(encoding="utf-8"))
    files = {path.name for path in FOLDER.glob("*.yaml")} - {"kustomization.yaml", "scaling.yaml"}
    assert set(kustomization["resources"]) == files
    assert [image["name"] for image in kustomization["images"]] == [container("api")["image"]]
    for kind in ("TriggerAuthentication", "ScaledObject"):
        (scaling,) = (each for each in MANIFESTS if each["kind"] == kind)
        assert scaling["metadata"]["namespace"] == kustomization["namespace"]


@pytest.mark.parametrize("role", OURS)
def test_commands_are_those_of_compose(role: str) -> None:
    assert container(role)["command"] == SERVICES[role]["command"]


@pytest.mark.parametrize("role", OURS)
def test_environment(role: str) -> None:
    """Every variable is a setting, and addresses come from the secret alone."""
    variables = {f"ARMATURE_{name.upper()}" for name in Settings.model_fields}
    given = {each["name"]: each for each in container(role)["env"]}
    assert set(given) <= variables
    assert set(SERVICES[role]["environment"]) - {"ARMATURE_HOME"} <= set(given)
    for name in ("ARMATURE_DATABASE_URL", "ARMATURE_BROKER_URL"):
        assert given[name]["valueFrom"]["secretKeyRef"]["name"] == SECRET
    values = {name.removeprefix("ARMATURE_").lower(): each["value"] for name, each in given.items() if "value" in each}
    Settings.model_validate(values)


@pytest.mark.parametrize("role", OURS)
def test_no_rights_that_are_not_needed(role: str) -> None:
    spec, only = pod(role)["spec"], container(role)
    (uid,) = re.findall(r"useradd .*--uid (\d+)", DOCKERFILE)
    assert re.findall(r"^USER (\S+)", DOCKERFILE, re.M) == [uid]  # a number: Kubernetes sees that it is not root
    assert spec["securityContext"]["runAsNonRoot"] is True
    assert spec["automountServiceAccountToken"] is False
    assert {spec["securityContext"][key] for key in ("runAsUser", "runAsGroup", "fsGroup")} == {int(uid)}
    assert only["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert only["resources"]["limits"].keys() == only["resources"]["requests"].keys() == {"cpu", "memory"}
    assert {mount["mountPath"] for mount in only["volumeMounts"]} == WRITTEN
    assert {mount["name"] for mount in only["volumeMounts"]} == {volume["name"] for volume in spec["volumes"]}
    assert all("emptyDir" in volume for volume in spec["volumes"])
    (home,) = re.findall(r"ARMATURE_HOME=(\S+)", DOCKERFILE)
    assert home in WRITTEN


def test_probes_and_ports_of_the_api(tmp_path: Path) -> None:
    only, app = container("api"), create_app(Settings(home=tmp_path))
    (port,) = only["ports"]
    assert str(port["containerPort"]) == only["command"][only["command"].index("--port") + 1]
    assert re.findall(r"^EXPOSE (\d+)", DOCKERFILE, re.M) == [str(port["containerPort"])]
    paths = app.openapi()["paths"]
    for kind in ("startupProbe", "livenessProbe", "readinessProbe"):
        probe = only[kind]["httpGet"]
        assert "get" in paths[probe["path"]]
        assert probe["port"] == port["name"]
    annotations = pod("api")["metadata"]["annotations"]
    assert "get" in paths[annotations["prometheus.io/path"]]
    assert annotations["prometheus.io/port"] == str(port["containerPort"])
    (served,) = named("Service", "armature-api")["spec"]["ports"]
    assert served["targetPort"] == port["name"]


def test_a_worker_has_time_to_end_and_is_judged_by_its_signs_of_life() -> None:
    grace = pod("worker")["spec"]["terminationGracePeriodSeconds"]
    assert grace > Settings().drain_s + GIVING_BACK_S + GOODBYE_S
    assert f"{grace}s" == SERVICES["worker"]["stop_grace_period"]
    assert container("worker")["livenessProbe"]["exec"]["command"] == SERVICES["worker"]["healthcheck"]["test"][1:]


@pytest.mark.parametrize("kind", ["Deployment", "Service", "PodDisruptionBudget"])
def test_selectors_find_their_pods(kind: str) -> None:
    for manifest in selecting(kind):
        selector = manifest["spec"]["selector"]
        labels = pod(manifest["metadata"]["name"].removeprefix("armature-"))["metadata"]["labels"]
        assert selector.get("matchLabels", selector).items() <= labels.items()
    components = [pod(role)["metadata"]["labels"]["app.kubernetes.io/component"] for role in OURS]
    assert components == list(OURS)


def selecting(kind: str) -> Iterator[dict[str, Any]]:
    """All of a kind; there are some."""
    found = [manifest for manifest in MANIFESTS if manifest["kind"] == kind]
    assert found
    yield from found


def test_an_eviction_is_possible_and_leaves_an_api() -> None:
    least = named("PodDisruptionBudget", "armature-api")["spec"]["minAvailable"]
    assert 1 <= least < named("Deployment", "armature-api")["spec"]["replicas"]


def test_the_scaler_counts_what_waits_and_runs(postgres: Server, tmp_path: Path) -> None:
    scaled = named("ScaledObject", "armature-worker")["spec"]
    assert scaled["scaleTargetRef"]["name"] == named("Deployment", "armature-worker")["metadata"]["name"]
    assert "replicas" not in named("Deployment", "armature-worker")["spec"]
    (trigger,) = scaled["triggers"]
    assert trigger["type"] == "postgresql"
    assert trigger["metadata"]["targetQueryValue"] == container("worker")["resources"]["limits"]["cpu"]
    authentication = named("TriggerAuthentication", trigger["authenticationRef"]["name"])["spec"]
    (reference,) = authentication["secretTargetRef"]
    database = next(each for each in container("worker")["env"] if each["name"] == "ARMATURE_DATABASE_URL")
    assert (reference["parameter"], reference["name"]) == ("connection", SECRET)
    assert reference["key"] == database["valueFrom"]["secretKeyRef"]["key"]
    with postgres_database(postgres) as url, psycopg.connect(url, autocommit=True) as connection:
        assert url.startswith("postgresql://")  # one address that both KEDA and the service read

        def asked() -> int:
            ((count,),) = connection.execute(trigger["metadata"]["query"]).fetchall()
            assert isinstance(count, int)
            return count

        upgrade(url)
        engine = make_engine(url)
        try:
            assert asked() == 0
            submit(engine, Settings(home=tmp_path, database_url=url), application())
            assert asked() == 3
            held = claim(engine, queued(engine)[0], "worker", LONG_LEASE_S)
            assert held is not None
            assert asked() == 3
            drain(engine)
            assert asked() == 1  # what is claimed still runs
        finally:
            engine.dispose()
