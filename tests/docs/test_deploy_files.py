"""The files in deploy/ use existing names only: settings, commands, options, programs, volumes and secrets."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import yaml

from command import robomark
from paths import ROOT
from service.settings import SECRET_FILES, Settings

DEPLOY = ROOT / "deploy"
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
MANIFESTS = [
    manifest for file in sorted(DEPLOY.glob("kubernetes/*.yaml")) for manifest in yaml.safe_load_all(file.read_text())
]
UNITS = sorted(DEPLOY.glob("systemd/*.service"))
FILES = [DEPLOY / "Dockerfile", *sorted(DEPLOY.rglob("*.yaml")), *UNITS]
SETTINGS = {f"ROBOMARK_{each.name.upper()}" for each in fields(Settings)}


def _containers() -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Yield name, pod and container of everything that the manifests run."""
    for manifest in MANIFESTS:
        if manifest["kind"] == "Deployment":
            pod = manifest["spec"]["template"]["spec"]
            yield from ((each["name"], pod, each) for each in pod["containers"])


def _commands() -> Iterator[list[str]]:
    """Yield every robomark command."""
    (command,) = re.findall(r"^CMD (\[.*\])$", (DEPLOY / "Dockerfile").read_text(), re.MULTILINE)
    yield yaml.safe_load(command)
    yield from (each["command"] for each in COMPOSE["services"].values() if each["image"] == "robomark")
    yield from (container["command"] for _, _, container in _containers())
    for unit in UNITS:
        (line,) = re.findall(r"^ExecStart=(.*)$", unit.read_text(), re.MULTILINE)
        program, *words = shlex.split(line)
        assert program == "/opt/robomark/bin/robomark", "where the Dockerfile and the operators' page have it"
        yield ["robomark", *words]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_variable_is_a_setting(file: Path) -> None:
    assert set(re.findall(r"ROBOMARK_[A-Z_]+", file.read_text())) <= SETTINGS
    assert set(re.findall(r"\b\w*CREDENTIALS\w*", file.read_text())) <= {SECRET_FILES}


@pytest.mark.long
def test_every_command_is_one_with_these_options() -> None:
    for command in sorted({tuple(words) for words in _commands()}):
        assert command[0] == "robomark"
        # Options are all parsed before the help is shown.
        result = robomark(*command[1:], "--help")
        assert result.returncode == 0, (command, result.stderr)
        assert f"robomark {command[1]}" in result.stdout


def test_everything_is_told_to_write_nowhere_else_and_to_gain_nothing() -> None:
    for name, service in COMPOSE["services"].items():
        assert service["read_only"] is True, name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["pids_limit"], name
        assert service["user"] not in ("root", "0"), name
        if service["image"] == "robomark":
            assert service["tmpfs"] == ["/tmp"], name
    for name, pod, container in _containers():
        assert pod["securityContext"]["runAsNonRoot"] is True, name
        assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}, name
        assert container["securityContext"] == {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        }, name


def test_what_compose_names_is_there() -> None:
    services = COMPOSE["services"]
    assert services["worker"]["deploy"]["replicas"] == 2
    for name, service in services.items():
        assert set(service.get("secrets", ())) <= COMPOSE["secrets"].keys(), name
        assert set(service["networks"]) <= COMPOSE["networks"].keys(), name
        assert set(service.get("depends_on", {})) <= services.keys(), name
        volumes = {volume.partition(":")[0] for volume in service.get("volumes", ())}
        assert volumes <= COMPOSE["volumes"].keys(), name
        # The Robomark image has a health check for containers that serve pages.
        assert "healthcheck" in service or service["command"][:2] == ["robomark", "serve"], name
    # Workers run student code, so they reach no other network.
    assert services["worker"]["networks"] == ["inside"]
    assert COMPOSE["networks"]["inside"]["internal"] is True


def test_what_the_manifests_name_is_there() -> None:
    labels = [each["spec"]["template"]["metadata"]["labels"] for each in MANIFESTS if each["kind"] == "Deployment"]
    for manifest in MANIFESTS:
        spec = manifest["spec"]
        selector = spec["podSelector" if manifest["kind"] == "NetworkPolicy" else "selector"]
        chosen = selector if manifest["kind"] == "Service" else selector["matchLabels"]
        assert chosen in labels, manifest["metadata"]["name"]
    for name, pod, container in _containers():
        mounted = {mount["name"] for mount in container["volumeMounts"]}
        assert mounted == {volume["name"] for volume in pod["volumes"]}, name
        assert {"startupProbe", "livenessProbe"} <= container.keys(), name
        secret = {each["name"] for each in container["env"] if "valueFrom" in each}
        assert secret == {"ROBOMARK_DATABASE_URL", "ROBOMARK_BROKER_URL"}, name


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="this machine has no systemd")
def test_systemd_takes_every_unit(unit: Path, tmp_path: Path) -> None:
    # The program and its user exist only where Robomark is installed this way.
    text = unit.read_text().replace("/opt/robomark/bin/robomark", sys.executable).replace("User=robomark\n", "")
    file = tmp_path / unit.name.replace("@.", "@1.")
    file.write_text(text)
    checked = subprocess.run(["systemd-analyze", "verify", str(file)], capture_output=True, text=True, check=False)
    about = [line for line in (checked.stdout + checked.stderr).splitlines() if file.name in line]
    assert (checked.returncode, about) == (0, []), checked.stderr


def test_units_give_what_student_code_runs_in_nothing_that_breaks_its_sandbox() -> None:
    for unit in UNITS:
        text = unit.read_text()
        assert "NoNewPrivileges=yes" in text
        assert "ProtectSystem=strict" in text
        if "robomark serve" not in text:
            assert "Delegate=memory pids io" in text
            assert not re.search(r"^(SystemCallFilter|RestrictNamespaces|ProcSubset|ProtectControlGroups)=", text, re.M)


def test_the_pages_name_every_file() -> None:
    document = (ROOT / "docs" / "operators.md").read_text()
    assert [file.name for file in FILES if f"deploy/{file.relative_to(DEPLOY)}" not in document] == []
