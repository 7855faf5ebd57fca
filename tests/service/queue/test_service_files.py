"""The unit file that the operators' page shows is one that systemd takes, and the page names every metric."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from paths import ROOT
from service.store.engine import Store
from service.web.metrics import metrics_text

PAGE = ROOT / "docs" / "operators.md"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="this machine has no systemd")
def test_the_unit_file_is_in_order(tmp_path: Path) -> None:
    (unit,) = re.findall(r"```ini\n(.*?)```", PAGE.read_text(), re.DOTALL)
    # The program and its user are there only where Robomark is installed so.
    unit = unit.replace("/opt/robomark/bin/robomark", sys.executable).replace("User=robomark\n", "")
    file = tmp_path / "robomark.service"
    file.write_text(unit)
    checked = subprocess.run(["systemd-analyze", "verify", str(file)], capture_output=True, text=True, check=False)
    about = [line for line in (checked.stdout + checked.stderr).splitlines() if "robomark.service" in line]
    assert (checked.returncode, about) == (0, []), checked.stderr


def test_every_metric_is_in_the_table(store: Store) -> None:
    shown = set(re.findall(r"^\| `(robomark_\w+)` \|", PAGE.read_text(), re.MULTILINE))
    told = {
        family.name + ("_total" if family.type == "counter" else "")
        for family in text_string_to_metric_families(metrics_text(store).decode())
    }
    assert shown == told
