"""The operators' page names every metric."""

from __future__ import annotations

import re

from prometheus_client.parser import text_string_to_metric_families

from acting import service_on
from paths import ROOT
from service.store.engine import Store
from service.web.metrics import render_metrics

PAGE = ROOT / "docs" / "operators.md"


def test_every_metric_is_in_the_table(store: Store) -> None:
    document = set(re.findall(r"^\| `(robomark_\w+)` \|", PAGE.read_text(), re.MULTILINE))
    documented_metrics = {
        family.name + ("_total" if family.type == "counter" else "")
        for family in text_string_to_metric_families(render_metrics(service_on(store)).decode())
    }
    assert document == documented_metrics
