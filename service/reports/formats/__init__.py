"""The output formats, one module per family, for ``robomark grade`` and ``robomark batch export``."""

from service.reports.formats.registry import FORMATS, Format
from sim.discovery import import_all

import_all(__name__, __path__)

__all__ = ["FORMATS", "Format"]
