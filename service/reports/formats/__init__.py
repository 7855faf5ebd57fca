"""The output formats, a module a family: what ``robomark grade`` prints and ``robomark batch export`` writes."""

from service.reports.formats.registry import FORMATS, Format
from sim.discovery import import_all

import_all(__name__, __path__)

__all__ = ["FORMATS", "Format"]
