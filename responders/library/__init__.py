"""Reference responders as text: submissions that work, and files that an assignment may give.

They are written as students write them and run inside the sandbox; nothing here imports one.
"""

from importlib import resources

NAMES = (
    "echo_responder",
    "json_responder",
    "image_parser",
    "shape_responder",
    "rule_responder",
    "digit_responder",
    "plain_digit_responder",
)


def source(name: str) -> str:
    """The text of a reference responder. Raises KeyError for a name that is not in ``NAMES``."""
    if name not in NAMES:
        raise KeyError(name)
    return (resources.files(__package__) / f"{name}.py").read_text(encoding="utf-8")
