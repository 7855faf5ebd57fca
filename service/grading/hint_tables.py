"""Tables of common student mistakes: advice on errors, usage of the brick, and the ports of its parts.

Data only. The rules that use these tables are in the other ``hint_`` modules.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from service.language import translatable

#: Advice on errors. Each pattern is searched in the error message plus a line feed and the line of code. In an advice,
#: ``\g<1>`` is the first group of the pattern.
ADVICE: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(error), advice)
    for error, advice in (
        (
            r'can only concatenate str \(not "(?:dict|list)".*\n.*JSON::',
            "Write json.dumps(...) around the object.",
        ),
        (r"can only concatenate str|must be str, not", "Convert other values with str(), or use an f-string."),
        (
            r"unsupported operand type\(s\) for \+=?: .*'str'.*\n.*(?:\+\s*f?[\"']|[\"']\s*\+)",
            "+ joins texts only: write str(...) around the number.",
        ),
        (
            r"unsupported operand type\(s\) for \+=?: .*'str'",
            "To join texts, write str(...) around the number; to add numbers, write int(...) around the text.",
        ),
        (
            r"unsupported operand type\(s\) for [-+*/]+=?: .*'str'|not supported between instances of .*'str'",
            "One of the two is a text: convert it with int() or float().",
        ),
        (
            r"unsupported operand type\(s\) .*'NoneType'|^(?:Type|Attribute)Error: 'NoneType' object",
            "A value is None: a function without return returns None.",
        ),
        (r"^(?:IndentationError|TabError)", "Indent all lines of a block by the same number of blanks, without tabs."),
        (r"^SyntaxError: invalid character '[\u2018-\u201f]", "Type straight quotes, as they are on the keyboard."),
        (r"^SyntaxError: invalid character '[\u2010-\u2015\u2212]", "Type the minus sign of the keyboard: -"),
        (r"^SyntaxError: invalid non-printable character", "A blank was copied with the text. Delete it, and type it."),
        (r"^SyntaxError.*\n\s*(>>>|\.\.\. )", "\\g<1> is Python's prompt: delete it at the start of each line."),
        (
            r"^SyntaxError.*\n\s*((?:In|Out) ?\[[ \d]*\]:)",
            "\\g<1> is a label of the notebook, not Python: delete it.",
        ),
        (r"^SyntaxError: expected ':'", "Put a colon at the end of this line."),
        (r"^SyntaxError: invalid syntax\n.*\bSpeedPercent\([^)]*$", "A closing bracket is missing."),
        (
            r"(?s)^IndexError.*pyState",
            "The queue was still empty: wait for an answer first, for example with time.sleep(1).",
        ),
        (r"^IndexError: list index out of range", "The list has no entry at this index. Check its length with len()."),
        (r"^TypeError: dump\(\)", "Did you mean json.dumps?"),
        (
            r"^ValueError: invalid literal for int\(\) with base 10: '(PY|IMG_DATA)::",
            'Remove the prefix first: text.removeprefix("\\g<1>::").',
        ),
        (
            r"^JSONDecodeError: Expecting value: line 1 column 1.*\n.*removeprefix\([\"'](PY|IMG_DATA|JSON):?[\"']\)",
            'The text still begins with a colon: write removeprefix("\\g<1>::").',
        ),
        (
            r"^JSONDecodeError: Expecting property name enclosed in double quotes",
            "JSON has double quotes. If the text is a Python dictionary, write ast.literal_eval, not json.loads.",
        ),
        (
            r"^JSONDecodeError: Expecting value: line 1 column 1.*\n.*loads\((?!.*removeprefix)",
            'The text is not JSON. Remove PY:: or IMG_DATA:: first, as in text.removeprefix("IMG_DATA::").',
        ),
        (r"^TypeError: the JSON object must be str.*not dict", "It is already an object: remove json.loads."),
        (
            r"^TypeError: Object of type u?int\d+ is not JSON serializable",
            "Convert the numpy number with int(...) before json.dumps.",
        ),
        (
            r"^TypeError: Object of type float\d+ is not JSON serializable",
            "Convert the numpy number with float(...) before json.dumps.",
        ),
        (
            r"^TypeError: Object of type bool_? is not JSON serializable",
            "Convert the numpy value with bool(...) before json.dumps.",
        ),
        (
            r"^TypeError: Object of type ndarray is not JSON serializable",
            "Convert the array with .tolist(), or take one element of it, before json.dumps.",
        ),
        (
            r"^TypeError: Object of type set is not JSON serializable",
            'Braces without a colon make a set. Write {"message": ...} with a colon after the key.',
        ),
        (
            r"^TypeError: keys must be str.*not u?int\d+",
            "Convert the numpy number with int(...) before it becomes a key.",
        ),
        (
            r"^TypeError: unhashable type: '(dict|list|ndarray)'",
            "A \\g<1> cannot be a key or in a set: after a key write a colon, not a comma.",
        ),
        (
            r"^TypeError: list indices must be integers or slices, not str\n.*messages",
            'The queue is a list: take its last message first, with ["messages"][-1], and then its key.',
        ),
        (
            r"^TypeError: list indices must be integers or slices, not str",
            "It is a list: take one entry first, for example the last one with [-1].",
        ),
        (
            r"^TypeError: only integer scalar arrays can be converted to a scalar index\n.*predict",
            "predict returns a list with one result for each image: take the first, int(network.predict(...)[0]).",
        ),
        (
            r"^TypeError: only (?:integer scalar|length-1|size-1|0-dimensional) arrays can be converted",
            "An array is used where one number is needed: take one element of it, as with int(...[0]).",
        ),
        (
            r"^TypeError: string indices must be integers",
            "It is a text and has no keys. Send an object from the responder, and call json.dumps only once.",
        ),
        (
            r"^TypeError: type '(\w+)' is not subscriptable",
            "\\g<1> is called with round brackets: write \\g<1>(...).",
        ),
        (
            r"^TypeError: '\w*function\w*' object is not subscriptable\n.*\b(say|print|sleep|len|round|abs)\[",
            "\\g<1> is called with round brackets: write \\g<1>(...).",
        ),
        (r"^TypeError: '\w*function\w*' object is not subscriptable\n.*\b(\w+)\[", "Call it first: \\g<1>()[...]."),
        (r"^TypeError: 'method' object is not subscriptable\n.*\b(\w+)\[", "Call it with round brackets: \\g<1>(...)."),
        (
            r"^TypeError: '\w*function\w*' object is not iterable|argument of type '\w*function\w*' is not iterable",
            "A function is named without brackets: add () to call it.",
        ),
        (
            r"^AttributeError: 'function' object has no attribute '(\w+)'\n.*\b\1\.\1\b",
            "\\g<1> is the function itself: write \\g<1>(...).",
        ),
        (
            r"^(?:TypeError|AttributeError): .*'\w*(?:function|method)\w*'",
            "A function or method is named without brackets: add () to call it.",
        ),
        (
            r"^AttributeError: 'dict' object has no attribute '(?:split|strip|removeprefix|replace|startswith|lower)'",
            'It is an object and no text: give one of its values, such as image["left"].',
        ),
        (
            r"^AttributeError: 'dict' object has no attribute '(?:append|add)'",
            "An object has keys: to add a value, write object[key] = value.",
        ),
        (
            r"^AttributeError: '(?:list|tuple)' object has no attribute '(?:split|strip|removeprefix|startswith)'",
            "It is a list and no text: take one entry, for example the last one with [-1].",
        ),
        (
            r"^AttributeError: '(int|float)' object has no attribute",
            "It is a number. To use it as a text, write str(...) around it.",
        ),
        (
            r"(\S+\.onnx) cannot be loaded as a model",
            'For an .onnx file write load_onnx("\\g<1>"), with from nn_tools import load_onnx above.',
        ),
        (r"^AttributeError: 'dict' object has no attribute '(\w+)'", 'Write ["\\g<1>"] to take a key of an object.'),
        (r"^AttributeError: 'str' object has no attribute 'append'", "It is a text: add to it with +."),
        (r"^TypeError: '(?:int|float)' object is not iterable\n.*\bfor\b", "Write range(...) around the number."),
        (r"^TypeError: 'float' object cannot be interpreted as an integer", "Use int(...) or // for a whole number."),
        (r"^UnboundLocalError.*'(\w+)'", "The function assigns \\g<1>, so it is local: write global \\g<1> above."),
        (r"^ZeroDivisionError", "Check that the divisor is not 0 before the division."),
        (r"^EOFError", "Remove input(), and write the value into the program."),
        (
            r"^ValueError: Expected 2D array, got 1D array",
            "predict expects a list of images, even for one image: add .reshape(1, -1).",
        ),
        (
            r"^ValueError: Found array with dim 3",
            "Give predict one row for each image: .reshape(number of images, -1), or .reshape(1, -1) for one.",
        ),
        (
            r"X has 400 features, but \w+ is expecting 196",
            "The network expects 14 x 14 images: crop the 20 x 20 image with [3:17, 3:17].",
        ),
        (
            r"X has 196 features, but \w+ is expecting 400",
            "The network expects 20 x 20 images: do not crop the image.",
        ),
        (
            r"X has (?:588|784|1200|1600) features, but \w+ is expecting (?:196|400)",
            "Give it one grey value for each pixel: take the mean of red, green and blue.",
        ),
        (
            r"X has (\d+) features, but \w+ is expecting (\d+)",
            "The network expects \\g<2> numbers for each image. Use images of the size that it was trained on.",
        ),
        (
            r"cannot reshape array of size 1600 into shape \(20,20(?:,3)?\)",
            "Each pixel has four numbers (red, green, blue, alpha): write reshape(20, 20, 4), and then [:, :, :3].",
        ),
        (
            r"cannot reshape array of size 1200 into shape",
            "This image has three numbers for each pixel: write reshape(20, 20, 3).",
        ),
        (
            r"cannot reshape array of size (\d+) into shape",
            "The shape's numbers, multiplied, must be \\g<1>.",
        ),
        (
            r"No \w+(?: sensor)? connected to.*\n.*[\"']((?:IN|OUT)PUT_\w)[\"']",
            "\\g<1> is the name of a port, not a text: write it without quotes.",
        ),
        (
            r"No motor connected to",
            "The motors are on OUTPUT_B (left) and OUTPUT_C (right).",
        ),
        (
            r"No color sensor connected to",
            "The light sensors are on INPUT_2 (left) and INPUT_3 (right).",
        ),
        (r"No ultrasonic sensor connected to", "The ultrasonic sensor is on INPUT_1."),
        (r"No gyro sensor connected to", "The gyro sensor is on INPUT_4."),
        (
            r"invalid (?:percentage|steering)|Invalid Speed Percentage",
            "Choose a number from -100 to 100.",
        ),
        (r"^ModuleNotFoundError", "Check its spelling, or submit the module's file beside your program."),
        (r"^ValueError: negative seconds|sleep length must be non-negative", "Wait for 0 seconds or more."),
        (r"^RecursionError", "A function calls itself endlessly: use a loop, or return before it calls itself."),
        (
            r"^NameError: name '(\w+)'",
            "Assign a value to \\g<1> above this line, or correct its spelling. If it is a text, put it in quotes.",
        ),
        (
            r"^TypeError: bad operand type for unary -: 'SpeedPercent'",
            "Write the minus in the brackets, before the number: SpeedPercent(-40).",
        ),
        (
            r"^TypeError: unsupported operand type\(s\) .*'SpeedPercent'",
            "Calculate in the brackets: SpeedPercent(speed + steering).",
        ),
        (
            r"^AttributeError: 'ColorSensor' object has no attribute",
            "Write reflected_light_intensity_pc for the light in percent, or color, color_name or rgb for the colour.",
        ),
        (
            r"^AttributeError: 'UltrasonicSensor' object has no attribute",
            "Write distance_centimeters for the distance.",
        ),
        (r"^AttributeError: 'GyroSensor' object has no attribute", "Write angle for the direction in degrees."),
        (
            r"^AttributeError: 'Move(?:Tank|Steering)' object has no attribute '(?:position|speed|degrees|rotations)'",
            "Each motor has its own: write tank_drive.left_motor.position, in degrees.",
        ),
        (
            r"^AttributeError: 'Move(?:Tank|Steering)' object has no attribute",
            "It has on, off, on_for_seconds, on_for_rotations and on_for_degrees.",
        ),
        (
            r"^AttributeError: 'LargeMotor' object has no attribute",
            "A motor has position, in degrees, and speed.",
        ),
        (
            r"^ValueError: Expected 2D array, got scalar array",
            "predict got a text or one number. Make an array of the image's pixels first, then .reshape(1, -1).",
        ),
        (
            r"invalid literal for int\(\) with base 10: '::?\s*-?\d",
            'The text still begins with a colon. Take all of the beginning off: text.removeprefix("PY::").',
        ),
        (
            r"invalid literal for int\(\) with base 10: '[^']*\d[^']*'",
            "The text contains more than the number: send the number alone, or remove the other words before int().",
        ),
        (r"'list' object has no attribute '(?:add|push|insert_end)'", "To add a value to a list, write append(...)."),
        (r"module 'math' has no attribute 'PI'", "Did you mean math.pi?"),
    )
)

#: Modules that students know from elsewhere and that are not available.
UNAVAILABLE_MODULES = frozenset(
    {
        "cv2",
        "IPython",
        "keras",
        "matplotlib",
        "pip",
        "plotly",
        "pybricks",
        "requests",
        "seaborn",
        "skimage",
        "tensorflow",
        "torch",
        "tqdm",
    }
)

#: The correct form of calls to a pair of motors, by object and method.
USAGE: Mapping[str, str] = MappingProxyType(
    {
        "tank_drive.on": "tank_drive.on(left speed, right speed)",
        "tank_drive.on_for_seconds": "tank_drive.on_for_seconds(left speed, right speed, seconds)",
        "tank_drive.on_for_rotations": "tank_drive.on_for_rotations(left speed, right speed, rotations)",
        "tank_drive.on_for_degrees": "tank_drive.on_for_degrees(left speed, right speed, degrees)",
        "tank_turn.on": "tank_turn.on(steering, speed)",
        "tank_turn.on_for_seconds": "tank_turn.on_for_seconds(steering, speed, seconds)",
        "tank_turn.on_for_rotations": "tank_turn.on_for_rotations(steering, speed, rotations)",
        "tank_turn.on_for_degrees": "tank_turn.on_for_degrees(steering, speed, degrees)",
    }
)

#: Properties of sensors and motors: minimum, maximum, and a sentence on the range or unit.
READINGS: Mapping[str, tuple[float, float, str]] = MappingProxyType(
    {
        "reflected_light_intensity": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "reflected_light_intensity_pc": (0, 100, translatable("%(reading)s is in percent, from 0 to 100")),
        "full_reflected_light_intensity": (0, 100, translatable("%(reading)s is in percent, from 0 to 100")),
        "distance_centimeters": (0, 255, translatable("%(reading)s is in centimetres")),
        "distance_inches": (0, 101, translatable("%(reading)s is in inches")),
        "color": (0, 7, translatable("%(reading)s is the number of a colour, from 0 to 7")),
        "red": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "green": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "blue": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "angle": (-1e9, 1e9, translatable("%(reading)s is in degrees, clockwise")),
        "position": (-1e9, 1e9, translatable("%(reading)s is in degrees")),
    }
)
#: Other names that are read without brackets.
PROPERTIES = frozenset(READINGS) | {
    "rate",
    "angle_and_rate",
    "rgb",
    "hsv",
    "hls",
    "lab",
    "raw",
    "color_name",
    "speed",
    "state",
    "is_running",
    "ambient_light_intensity",
    "distance_centimeters_continuous",
    "distance_inches_continuous",
}

#: Calls with a time or an amount as their last argument: largest plausible value, and its unit.
AMOUNTS: Mapping[str, tuple[float, Literal["seconds", "rotations"]]] = MappingProxyType(
    {
        "sleep": (100, "seconds"),
        "on_for_seconds": (100, "seconds"),
        "on_for_rotations": (30, "rotations"),
    }
)

#: Methods and functions that have an effect only when called.
ACTIONS = frozenset(
    {
        "on",
        "off",
        "stop",
        "on_for_seconds",
        "on_for_rotations",
        "on_for_degrees",
        "run_forever",
        "run_timed",
        "run_to_rel_pos",
        "speak",
        "beep",
        "say",
        "print",
        "append",
        "sleep",
    }
)
#: The actions that start a robot moving, and those that move it and wait.
CONTINUOUS_MOVES = frozenset({"on", "run_forever", "run_direct"})
LIMITED_MOVES = frozenset({"on_for_seconds", "on_for_rotations", "on_for_degrees"})
