"""The kinds of faults are found in the sentences of this Python."""

from __future__ import annotations

import pytest

from service.grading.fault_kinds import FaultKind, is_kind, read_values
from sim.recording import Fault, Verdict

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(
    ("source", "kind", "values"),
    [
        ("speaker.say('a')", FaultKind.UNDEFINED_NAME, ("speaker",)),
        ("'a'.apend(1)", FaultKind.NO_ATTRIBUTE, ("str", "apend")),
        ("text = 'a'\ntext(1)", FaultKind.NOT_CALLABLE, ("str",)),
        ("def go(speed): pass\ngo()", FaultKind.WRONG_ARGUMENTS, ("", "go")),
        ("class Car:\n    def go(): pass\nCar().go()", FaultKind.WRONG_ARGUMENTS, ("Car", "go")),
        ("red, green = 1, 2, 3", FaultKind.WRONG_UNPACKING, ()),
        ("text = 'a'\ntext['b']", FaultKind.TEXT_INDEX, ()),
        ("None.angle", FaultKind.NONE_OBJECT, ()),
        ("float('left')", FaultKind.NO_NUMBER, ()),
        ("[][0]", FaultKind.LIST_INDEX, ()),
        ("{}['label']", FaultKind.NO_KEY, ("label",)),
        ("import ev4dev.motor", FaultKind.NO_MODULE, ("ev4dev",)),
        ("open('none.csv')", FaultKind.NO_FILE, ("none.csv",)),
        ("if True:\nprint(1)", FaultKind.NO_BLOCK, ("1",)),
        ("print('a)", FaultKind.UNCLOSED_TEXT, ("",)),
        ("print('''a", FaultKind.UNCLOSED_TEXT, ("triple-quoted ",)),
    ],
)
def test_an_error_of_python_has_its_kind_and_values(source: str, kind: FaultKind, values: tuple[str, ...]) -> None:
    with pytest.raises(Exception) as caught:  # noqa: PT011 - each source raises another class
        exec(source, {})
    error = caught.value
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    fault = Fault(0.0, Verdict.PROGRAM_ERROR, "program", f"{type(error).__name__}: {text}", 1)
    assert read_values(fault, kind) == values
    assert is_kind(fault, kind)
    assert not is_kind(fault, FaultKind.MISSING_FUNCTION, FaultKind.MISSING_RESPONDER)
