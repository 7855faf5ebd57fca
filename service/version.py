"""The version that grades and reports name."""

from importlib.metadata import version

GRADER_VERSION = version("robomark")
