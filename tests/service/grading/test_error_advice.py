"""Advice on errors: from the text of the program and Python's own message."""

from __future__ import annotations

import pytest

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_errors import advise_on_error
from sim.recording import Fault, Verdict

pytestmark = pytest.mark.fast


def advice(text: str, message: str, line: int) -> str:
    """Return the advice on an error in a robot program."""
    listing = Listing("robot.py", "program", tuple(text.split("\n")))
    clues = Clues((listing,), (), (), (), None, "preloaded", False)
    return advise_on_error(Fault(0.0, Verdict.PROGRAM_ERROR, "program", message, line), clues)


def syntax_advice(text: str) -> str:
    """Return the advice on a program that Python cannot parse, with Python's own message."""
    with pytest.raises(SyntaxError) as caught:
        compile(text, "robot.py", "exec")
    error = caught.value
    return advice(text, f"{type(error).__name__}: {error.msg}", error.lineno or 1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('say "hello"', 'write say("hello")'),
        ("say count", "write say(count)"),
        ("tank_drive.on 50, 50", "write tank_drive.on(50, 50)"),
        ('print "PY::" + str(count)', 'write print("PY::" + str(count))'),
        ("while count => 0:\n    pass", "Write >="),
        ("while count =< 0:\n    pass", "Write <="),
        ("while count <> 0:\n    pass", "Write !="),
        ("while count > = 0:\n    pass", "Write >="),
        ("if count = = 3:\n    pass", "Write =="),
        ("tank_drive.on(50%, 50%)", "write 50 in place of 50%"),
        ("time.sleep(2s)", "write 2 in place of 2s"),
        ("distance = 30 cm", "write 30 in place of 30 cm"),
        ("print(PY::hello)", 'write print("PY::hello")'),
        ("print(IMG_DATA::)", 'write print("IMG_DATA::")'),
        ('print("Light: " light)', "write + between them"),
        ('say(name " is here")', "write + between them"),
        ("count = 10 while count > 0:\n    pass", "begins at while"),
        ('say("a") print("b")', "begins at print"),
        ("if a:\n    b = 1\nelif:\n    b = 2", "write else:"),
        ("while:\n    b = 2", "needs a condition"),
        ("if a:\n    b = 1\nelse a > 3:\n    b = 2", "or elif a > 3:"),
        ("```\nsay(1)\n```", "Delete each line that begins with ```"),
        ("1 say(1)", "Delete the numbers"),
        ("12: say(1)", "Delete the numbers"),
        ("While count < 10:\n    pass", "Write while."),
        ("Def area(side):\n    pass", "Write def."),
        ("while (a > 3 And b > 3):\n    pass", "Write and."),
        ("while Not a > 3:\n    pass", "Write not."),
        ("count - = 1", "Write -="),
        ("total + = 2", "Write +="),
        ("for i in range(10; 101; 10):\n    pass", "Write for i in range(10, 101, 10):"),
        ("tank_drive.on(50; 50)", "Write tank_drive.on(50, 50)"),
        ("for count in 1 to 5:\n    pass", "write for count in range(1, 6):"),
        ("for i = 0 to n:\n    pass", "write for i in range(0, n + 1):"),
        ("foreach day in days:\n    pass", "Write for day in days:"),
        ("for each day in days:\n    pass", "Write for day in days:"),
        ("until light == 0:\n    pass", "Write while not (light == 0):"),
        ("repeat until light < 5:\n    pass", "Write while not (light < 5):"),
        ("unless a:\n    pass", "Write if not (a):"),
        ("repeat 4:\n    pass", "Write for _ in range(4):"),
        ("repeat 4 times:\n    pass", "Write for _ in range(4):"),
        ("forever:\n    pass", "Write while True:"),
        ("function square(side):\n    pass", "Write def square(side):"),
        ('x = {"message" = f"saw {y}"}', 'Write "message": in place'),
        ("x = {'a': 1, 'b' = 2}", "Write 'b': in place"),
        ('print(f"Light: {colorLeft.color")', 'Write print(f"Light: {colorLeft.color}")'),
        ("if a:\n    b = 1\n    else:\n        b = 2", "if in line 1. Begin both lines with 0 blanks"),
        ("while c:\n    if a:\n        b = 1\n        elif d:\n            b = 2", "Begin both lines with 4 blanks"),
        ("if a:\n    b = 1\nc = 2\nelse:\n    b = 2", "Line 3 stands between if in line 1"),
        ("try:\n    b = 1\n    except ValueError:\n    b = 2", "try in line 1. Begin both lines with 0 blanks"),
        ("speed = \u221250", "minus sign of the keyboard"),
        ("speed = \u201350", "minus sign of the keyboard"),
        ("speed\u00a0= 50", "A blank was copied"),
    ],
)
def test_a_line_that_python_cannot_parse_has_its_fix(text: str, words: str) -> None:
    assert words in syntax_advice(text)


@pytest.mark.parametrize(
    ("text", "never"),
    [
        ('say("=>")\nif a b:\n    pass', "no sign"),
        ('print("50%)', "no unit"),
        ('print("PY::" + a b)', "needs quotes"),
        ("return if", "brackets"),
        ('x = ["a" "b" c', "line number"),
        ("10 + + * 3", "line number"),
        ("say if", "brackets"),
        ("x = [a for b in c", "begins at"),
        ("x = y + z w", "begins at"),
        ('say("a; b" c', "commas"),
        ('say("While" c', "small letters"),
        ("Not_mine = a b", "small letters"),
        ("print(a b, end = 3)", "no sign"),
        ("x = y[until z", "no until"),
        ('print({"a": b c})', "colon"),
        ("if a:\n    b = 1\nelse c", "Begin both"),
    ],
)
def test_a_fix_is_not_for_another_mistake(text: str, never: str) -> None:
    assert never not in syntax_advice(text)


_NONE = "TypeError: unsupported operand type(s) for -: 'NoneType' and 'NoneType'"
_SEQUENCE = "TypeError: can't multiply sequence by non-int of type 'float'"
_STR_INT = "TypeError: '<' not supported between instances of 'str' and 'int'"


@pytest.mark.parametrize(
    ("text", "message", "words"),
    [
        ('count = "1"\nwhile count < 10:', _STR_INT, "Write count = 1"),
        ("speed = '40'\nspeed = speed + 10", 'TypeError: can only concatenate str (not "int") to str', "speed = 40"),
        ('a = "one"\nwhile a < 10:', _STR_INT, "int()"),
        (
            "speed = 1,5\nx = speed * 2 + 3",
            'TypeError: can only concatenate tuple (not "int") to tuple',
            "In line 1, 1,5 is two numbers",
        ),
        (
            "import time\ntime.sleep(0,5)",
            "TypeError: time.sleep() takes exactly one argument (2 given)",
            "write 0.5",
        ),
        (
            "gyro = GyroSensor(INPUT_4)\nif gyro > 90:",
            "TypeError: '>' not supported between instances of 'GyroSensor' and 'int'",
            "gyro.angle",
        ),
        (
            "import time\nwhile tank_drive.left_motor < 1000:",
            "TypeError: '<' not supported between instances of 'LargeMotor' and 'int'",
            "tank_drive.left_motor.position",
        ),
        (
            "a = 1\nx = ultrasonic / 10",
            "TypeError: unsupported operand type(s) for /: 'UltrasonicSensor' and 'int'",
            "ultrasonic.distance_centimeters",
        ),
        ('a = 1\ntank_drive.on_for_seconds(50, 50, "2")', _STR_INT, "Write 2."),
        ('far = "3"\ntank_drive.on_for_rotations(40, 40, far)', _SEQUENCE, "Write far = 3 there"),
        (
            "def go(far):\n    tank_drive.on_for_rotations(40, 40, far)\ngo([1, 2])",
            _SEQUENCE,
            "Line 3 gives go a whole list. Call it once for each entry: for value in [1, 2]:",
        ),
        (
            "a = 1\nb = day + 1\nfor day in range(3):",
            "NameError: name 'day' is not defined",
            "Move line 2 into the loop",
        ),
        (
            "a = None\nif a == 0:\n    a = 1\nb = a - a",
            _NONE,
            "line 3 has not run. Check the condition in line 2, a == 0. None never equals 0: write a is None.",
        ),
        (
            "a = None\nwhile a - a:\n    if b > 9:\n        a = b",
            _NONE,
            "Check the condition in line 3, b > 9.",
        ),
        (
            "a = []\na = a.append(3)\na = a.append(4)",
            "AttributeError: 'NoneType' object has no attribute 'append'",
            "line 2 makes a None. Write a.append(3) alone there",
        ),
        (
            "i = 0\nwhile i <= len(x):\n    y = x[i]",
            "IndexError: list index out of range",
            "Write < in place of <= in line 2",
        ),
        ("for i in range(len(x) + 1):\n    y = x[i]", "IndexError: list index out of range", "Remove + 1"),
        (
            "a = 1\ntank_drive.on(SpeedPercent(30 + a), SpeedPercent(30))",
            "ValueError: 130 is an invalid percentage, must be between -100 and 100 (inclusive)",
            "SpeedPercent(max(-100, min(100, 30 + a)))",
        ),
        (
            "a = 1\nn = sum(places)",
            "TypeError: unsupported operand type(s) for +: 'int' and 'tuple'",
            "To count the entries, write len(...)",
        ),
        (
            "speed = 30\ntank_drive.on(SpeedPercent(speed + 100), SpeedPercent(30))",
            "ValueError: 130 is an invalid percentage, must be between -100 and 100 (inclusive)",
            "from -100 to 100",
        ),
        ("x = 1\nprint['a']", "TypeError: 'builtin_function_or_method' object is not subscriptable", "print(...)"),
        ("x = 1\nx = int['5']", "TypeError: type 'int' is not subscriptable", "int(...)"),
        (
            "try:\n    x = int(y)\nexcept KeyError:\n    x = 0",
            "ValueError: could not convert string to float: 'a'",
            "(KeyError, ValueError)",
        ),
        (
            "try:\n    x = a[b]\nexcept (KeyError, ValueError):\n    x = 0",
            "TypeError: unhashable",
            "(KeyError, ValueError, TypeError)",
        ),
        (
            "import ev3dev2_glue\nglue.pyState()",
            "NameError: name 'glue' is not defined",
            "Write import ev3dev2_glue as glue there",
        ),
        ("x = 1\nglue.pyState()", "NameError: name 'glue' is not defined", "Add import ev3dev2_glue as glue"),
        ("x = 1\nx.split(',')", "AttributeError: 'dict' object has no attribute 'split'", 'such as image["left"]'),
        ("x = 1\nx.split(',')", "AttributeError: 'list' object has no attribute 'split'", "take one entry"),
        ("x = 1\nx.strip()", "AttributeError: 'int' object has no attribute 'strip'", "str(...)"),
        (
            "x = 1\nsay(1, Wait=True)",
            "TypeError: say() got an unexpected keyword argument 'Wait'",
            "Did you mean wait=?",
        ),
        (
            "def go(speed): pass\ngo(sped=1)",
            "TypeError: go() got an unexpected keyword argument 'sped'",
            "Did you mean speed=?",
        ),
        (
            "x = 1\nsay(1, loud=True)",
            "TypeError: say() got an unexpected keyword argument 'loud'",
            "leave loud=... out",
        ),
        (
            'NAMES = ["a", "b"]\nname = NAMES[network.predict(x)[0]]',
            "IndexError: list index out of range",
            "NAMES has 2 names",
        ),
        (
            "factor = [1, 2, 1]\nway = factor * 2.5",
            "TypeError: can't multiply sequence by non-int of type 'float'",
            "Line 1 makes factor a whole list",
        ),
        (
            "def responder(message):\n    return text[4:]",
            "NameError: name 'text' is not defined",
            "write message in place of text",
        ),
        (
            "x = 1\nfit(images, labels)",
            "ValueError: inconsistent numbers of samples: [140, 10]",
            "each image became 14 rows",
        ),
        (
            "grey = pixels.mean(axis=0)\nnetwork.predict(grey)",
            "ValueError: X has 42 features, but MLPClassifier is expecting 196 features as input",
            "write axis=2",
        ),
        ("x = 1\nx = right", "NameError: name 'right' is not defined", "put it in quotes"),
    ],
)
def test_a_value_of_the_wrong_type_has_its_fix(text: str, message: str, words: str) -> None:
    assert words in advice(text, message, 2)
