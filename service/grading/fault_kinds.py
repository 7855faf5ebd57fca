"""The kinds of faults that hints distinguish, with their values, such as the name that is not defined.

Python describes most errors in a sentence only, and so do the recordings of old grades. Hints compare kinds and values,
and no other module of the grader reads the sentences.
"""

from __future__ import annotations

import re
from enum import Enum

from sim.recording import Fault


class FaultKind(Enum):
    """The beginning or a part of the sentence for each kind. Its groups are the values, in the order of the comment."""

    UNDEFINED_NAME = r"^NameError: name '(\w+)' is not defined"  # name
    NAME_ERROR = r"^NameError"
    NO_ATTRIBUTE = r"^AttributeError: '(\w+)' object has no attribute '(\w+)'"  # type, attribute
    NOT_CALLABLE = r"^TypeError: '(\w+)' object is not callable"  # type
    WRONG_ARGUMENTS = r"^TypeError: (?:([\w.]+)\.)?(\w+)\(\) (?:takes|missing)"  # class, function
    WRONG_UNPACKING = r"^ValueError: (?:too many|not enough) values to unpack"
    TOO_MANY_ARGUMENTS = r"^TypeError: .* takes .* (?:given|positional)"
    #: function, keyword
    UNEXPECTED_KEYWORD = r"^TypeError: (?:\w+\.)*(\w+)\(\) got an unexpected keyword argument '(\w+)'"
    TEXT_OPERAND = (
        r"^TypeError: (?:unsupported operand type\(s\) for |'[<>=]+' not supported between |can only concatenate )"
        r".*\bstr\b"
    )
    LIST_OPERAND = r"^TypeError: .*(?:'list'|can't multiply sequence|can only concatenate list)"
    TUPLE_OPERAND = r"^TypeError: .*\btuple\b"
    DEVICE_OPERAND = r"^TypeError: .*'(ColorSensor|UltrasonicSensor|GyroSensor|LargeMotor)'"  # class
    JOINED_OBJECT = r"can only concatenate str \(not \"dict\"\)"
    FEATURE_COUNTS = r"X has (\d+) features, but \w+ is expecting (\d+)"  # actual, expected
    SAMPLE_COUNTS = r"inconsistent numbers of samples: \[(\d+), (\d+)\]"  # rows, labels
    TEXT_LABELS = r"did not contain a loop with signature matching types \(dtype\('<U"
    ANY_EXCEPTION = r"^(?:\w+\.)*(\w+): "  # class
    TEXT_INDEX = r"^TypeError: string indices"
    NONE_OBJECT = r"'NoneType' object"
    NO_NUMBER = r"could not convert string to float"
    NO_SPEED = r"SpeedPercent"
    INDEX_ERROR = r"IndexError"
    LIST_INDEX = r"IndexError: list index out of range"
    NO_KEY = r"^KeyError: '([^']+)'"  # key
    NO_MODULE = r"^ModuleNotFoundError: No module named '([\w.]+)'"  # module
    NO_FILE = r"FileNotFoundError: \[Errno 2\] No such file or directory: '([^']+)'"  # path
    NO_ACCESS = r"^PermissionError|Permission denied|may only open files"
    SYNTAX_ERROR = r"^SyntaxError"
    INDENTATION_ERROR = r"^IndentationError"
    NO_BLOCK = r"^IndentationError: expected an indented block after .{1,60}? on line (\d+)"  # line of the block's head
    UNCLOSED_TEXT = r"^SyntaxError: unterminated (triple-quoted )?(?:f-)?string literal"  # empty with single quotes
    #: The types of both operands, one of which is None.
    NONE_OPERAND = (
        r"^TypeError: (?=.*'NoneType').*(?:operand type\(s\) for .*|between instances of) '(\w+)' and '(\w+)'"
    )
    BAD_PERCENTAGE = r"(-?[\d.]+) is an invalid percentage"  # percentage
    MISSING_ARGUMENT = r"(\w+)\(\) missing 1 required positional argument: '(\w+)'"  # function, parameter
    OPEN_BRACE = r"^SyntaxError: f-string: expecting '}'"
    #: Functions of the student that Robomark calls.
    MISSING_FUNCTION = r"there is no function called (\w+)"  # function
    NO_RETURN = r"TypeError: (\w+) returned NoneType, which has no \w+"  # function
    MISSING_RESPONDER = r"there is no responder: "
    RESPONDER_NO_FUNCTION = r"roboSim.pyresponder is "
    NO_ANSWER = r"^the responder returned NoneType"
    UNREADABLE_ANSWER = r"the responder returned \w+|begins with JSON:: but is not JSON"


_PATTERNS = {kind: re.compile(kind.value) for kind in FaultKind}


def read_values(fault: Fault, kind: FaultKind) -> tuple[str, ...] | None:
    """Return the values of a fault of this kind, with empty texts for those that it lacks; None for another kind."""
    match = _PATTERNS[kind].search(fault.message)
    return None if match is None else match.groups(default="")


def is_kind(fault: Fault, *kinds: FaultKind) -> bool:
    """Return whether a fault is of one of these kinds."""
    return any(read_values(fault, kind) is not None for kind in kinds)
