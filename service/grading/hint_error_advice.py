"""Advice on errors by their messages, for ``hint_errors.py``. Data only."""

from __future__ import annotations

import re

from service.language import translatable

#: Each pattern is searched in the error message plus a line feed and the line of code. The values of an advice are the
#: named groups of its pattern.
ADVICE: tuple[tuple[re.Pattern[str], str], ...] = tuple(
    (re.compile(error), advice)
    for error, advice in (
        (
            r'can only concatenate str \(not "(?:dict|list)".*\n.*JSON::',
            translatable("Write json.dumps(...) around the object."),
        ),
        (
            r'can only concatenate str \(not "list".*\n.*(?:pyState|messages|answer)',
            translatable("The answer has a whole list here. Let the responder send one value of it."),
        ),
        (
            r"can only concatenate str|must be str, not",
            translatable("Convert other values with str(), or use an f-string."),
        ),
        (
            r"unsupported operand type\(s\) for \+: 'int' and '(?:tuple|list|dict|str)'\n.*\bsum\(",
            translatable("sum adds numbers. To count the entries, write len(...)."),
        ),
        (
            r"unsupported operand type\(s\) for \+=?: .*'str'.*\n.*(?:\+\s*f?[\"']|[\"']\s*\+)",
            translatable("+ joins texts only: write str(...) around the number."),
        ),
        (
            r"unsupported operand type\(s\) for \+=?: .*'str'",
            translatable(
                "To join texts, write str(...) around the number; to add numbers, write int(...) around the text."
            ),
        ),
        (
            r"unsupported operand type\(s\) for [-+*/]+=?: .*'str'|not supported between instances of .*'str'",
            translatable("One of the two is a text: convert it with int() or float()."),
        ),
        (
            r"unsupported operand type\(s\) .*'NoneType'|^(?:Type|Attribute)Error: 'NoneType' object",
            translatable("A value is None: a function without return returns None."),
        ),
        (
            r"^(?:IndentationError|TabError)",
            translatable("Indent all lines of a block by the same number of blanks, without tabs."),
        ),
        (
            r"^SyntaxError: invalid character '[\u2018-\u201f]",
            translatable("Type straight quotes, as they are on the keyboard."),
        ),
        (
            r"^SyntaxError: invalid character '[\u2010-\u2015\u2212]",
            translatable("Type the minus sign of the keyboard: -"),
        ),
        (
            r"^SyntaxError: invalid non-printable character",
            translatable("A blank was copied with the text. Delete it, and type it."),
        ),
        (
            r"^SyntaxError.*\n\s*(?P<prompt>>>>|\.\.\. )",
            translatable("%(prompt)s is Python's prompt: delete it at the start of each line."),
        ),
        (
            r"^SyntaxError.*\n\s*(?P<label>(?:In|Out) ?\[[ \d]*\]:)",
            translatable("%(label)s is a label of the notebook, not Python: delete it."),
        ),
        (r"^SyntaxError: expected ':'", translatable("Put a colon at the end of this line.")),
        (r"^SyntaxError: invalid syntax\n.*\bSpeedPercent\([^)]*$", translatable("A closing bracket is missing.")),
        (
            r"(?s)^IndexError.*pyState",
            translatable("The queue was still empty: wait for an answer first, for example with time.sleep(1)."),
        ),
        (
            r"^IndexError: list index out of range",
            translatable("The list has no entry at this index. Check its length with len()."),
        ),
        (r"^TypeError: dump\(\)", translatable("Did you mean json.dumps?")),
        (
            r"^ValueError: invalid literal for int\(\) with base 10: '(?P<prefix>PY|IMG_DATA)::",
            translatable('Remove the prefix first: text.removeprefix("%(prefix)s::").'),
        ),
        (
            r"^JSONDecodeError: Expecting value: line 1 column 1.*\n"
            r".*removeprefix\([\"'](?P<prefix>PY|IMG_DATA|JSON):?[\"']\)",
            translatable('The text still begins with a colon: write removeprefix("%(prefix)s::").'),
        ),
        (
            r"^JSONDecodeError: Expecting property name enclosed in double quotes",
            translatable(
                "JSON has double quotes. If the text is a Python dictionary, write ast.literal_eval, not json.loads."
            ),
        ),
        (
            r"^JSONDecodeError: Expecting value: line 1 column 1.*\n.*loads\((?!.*removeprefix)",
            translatable(
                'The text is not JSON. Remove PY:: or IMG_DATA:: first, as in text.removeprefix("IMG_DATA::").'
            ),
        ),
        (
            r"^TypeError: the JSON object must be str.*not dict",
            translatable("It is already an object: remove json.loads."),
        ),
        (
            r"^TypeError: Object of type u?int\d+ is not JSON serializable",
            translatable("Convert the numpy number with int(...) before json.dumps."),
        ),
        (
            r"^TypeError: Object of type float\d+ is not JSON serializable",
            translatable("Convert the numpy number with float(...) before json.dumps."),
        ),
        (
            r"^TypeError: Object of type bool_? is not JSON serializable",
            translatable("Convert the numpy value with bool(...) before json.dumps."),
        ),
        (
            r"^TypeError: Object of type ndarray is not JSON serializable",
            translatable("Convert the array with .tolist(), or take one element of it, before json.dumps."),
        ),
        (
            r"^TypeError: Object of type set is not JSON serializable",
            translatable('Braces without a colon make a set. Write {"message": ...} with a colon after the key.'),
        ),
        (
            r"^TypeError: keys must be str.*not u?int\d+",
            translatable("Convert the numpy number with int(...) before it becomes a key."),
        ),
        (
            r"^TypeError: unhashable type: '(?P<kind>dict|list|ndarray)'",
            translatable("A %(kind)s cannot be a key or in a set: after a key write a colon, not a comma."),
        ),
        (
            r"^TypeError: list indices must be integers or slices, not str\n.*messages",
            translatable('The queue is a list: take its last message first, with ["messages"][-1], and then its key.'),
        ),
        (
            r"^TypeError: list indices must be integers or slices, not str",
            translatable("It is a list: take one entry first, for example the last one with [-1]."),
        ),
        (
            r"^TypeError: only integer scalar arrays can be converted to a scalar index\n.*predict",
            translatable(
                "predict returns a list with one result for each image: take the first, int(network.predict(...)[0])."
            ),
        ),
        (
            r"^TypeError: only (?:integer scalar|length-1|size-1|0-dimensional) arrays can be converted",
            translatable("An array is used where one number is needed: take one element of it, as with int(...[0])."),
        ),
        (
            r"^TypeError: string indices must be integers",
            translatable(
                "It is a text and has no keys. Send an object from the responder, and call json.dumps only once."
            ),
        ),
        (
            r"^TypeError: type '(?P<name>\w+)' is not subscriptable",
            translatable("%(name)s is called with round brackets: write %(name)s(...)."),
        ),
        (
            r"^TypeError: '\w*function\w*' object is not subscriptable\n.*\b(?P<name>say|print|sleep|len|round|abs)\[",
            translatable("%(name)s is called with round brackets: write %(name)s(...)."),
        ),
        (
            r"^TypeError: '\w*function\w*' object is not subscriptable\n.*\b(?P<name>\w+)\[",
            translatable("Call it first: %(name)s()[...]."),
        ),
        (
            r"^TypeError: 'method' object is not subscriptable\n.*\b(?P<name>\w+)\[",
            translatable("Call it with round brackets: %(name)s(...)."),
        ),
        (
            r"^TypeError: '\w*function\w*' object is not iterable|argument of type '\w*function\w*' is not iterable",
            translatable("A function is named without brackets: add () to call it."),
        ),
        (
            r"^AttributeError: 'function' object has no attribute '(?P<name>\w+)'\n.*\b(?P=name)\.(?P=name)\b",
            translatable("%(name)s is the function itself: write %(name)s(...)."),
        ),
        (
            r"^(?:TypeError|AttributeError): .*'\w*(?:function|method)\w*'",
            translatable("A function or method is named without brackets: add () to call it."),
        ),
        (
            r"^AttributeError: 'dict' object has no attribute '(?:split|strip|removeprefix|replace|startswith|lower)'",
            translatable('It is an object and no text: give one of its values, such as image["left"].'),
        ),
        (
            r"^AttributeError: 'dict' object has no attribute '(?:append|add)'",
            translatable("An object has keys: to add a value, write object[key] = value."),
        ),
        (
            r"^AttributeError: '(?:list|tuple)' object has no attribute '(?:split|strip|removeprefix|startswith)'",
            translatable("It is a list and no text: take one entry, for example the last one with [-1]."),
        ),
        (
            r"^AttributeError: '(int|float)' object has no attribute",
            translatable("It is a number. To use it as a text, write str(...) around it."),
        ),
        (
            r"(?P<file>\S+\.onnx) cannot be loaded as a model",
            translatable('For an .onnx file write load_onnx("%(file)s"), with from nn_tools import load_onnx above.'),
        ),
        (
            r"^AttributeError: 'dict' object has no attribute '(?P<key>\w+)'",
            translatable('Write ["%(key)s"] to take a key of an object.'),
        ),
        (r"^AttributeError: 'str' object has no attribute 'append'", translatable("It is a text: add to it with +.")),
        (
            r"^TypeError: '(?:int|float)' object is not iterable\n.*\bfor\b",
            translatable("Write range(...) around the number."),
        ),
        (
            r"^TypeError: 'float' object cannot be interpreted as an integer",
            translatable("Use int(...) or // for a whole number."),
        ),
        (
            r"^UnboundLocalError.*'(?P<name>\w+)'",
            translatable("The function assigns %(name)s, so it is local: write global %(name)s above."),
        ),
        (r"^ZeroDivisionError", translatable("Check that the divisor is not 0 before the division.")),
        (r"^EOFError", translatable("Remove input(), and write the value into the program.")),
        (
            r"^ValueError: Expected 2D array, got 1D array",
            translatable("predict expects a list of images, even for one image: add .reshape(1, -1)."),
        ),
        (
            r"^ValueError: Found array with dim 3",
            translatable(
                "Give predict one row for each image: .reshape(number of images, -1), or .reshape(1, -1) for one."
            ),
        ),
        (
            r"X has 400 features, but \w+ is expecting 196",
            translatable("The network expects 14 x 14 images: crop the 20 x 20 image with [3:17, 3:17]."),
        ),
        (
            r"X has 196 features, but \w+ is expecting 400",
            translatable("The network expects 20 x 20 images: do not crop the image."),
        ),
        (
            r"X has (?:588|784|1200|1600) features, but \w+ is expecting (?:196|400)",
            translatable("Give it one grey value for each pixel: take the mean of red, green and blue."),
        ),
        (
            r"X has 14 features, but \w+ is expecting 196|X has 20 features, but \w+ is expecting 400",
            translatable("The image still has rows. Make one row of it with .reshape(1, -1)."),
        ),
        (
            r"X has (\d+) features, but \w+ is expecting (?P<expected>\d+)",
            translatable(
                "The network expects %(expected)s numbers for each image. Use images of the size that it was trained "
                "on."
            ),
        ),
        (
            r"cannot reshape array of size 1600 into shape \(20,20(?:,3)?\)",
            translatable(
                "Each pixel has four numbers (red, green, blue, alpha): write reshape(20, 20, 4), and then [:, :, :3]."
            ),
        ),
        (
            r"cannot reshape array of size 1200 into shape",
            translatable("This image has three numbers for each pixel: write reshape(20, 20, 3)."),
        ),
        (
            r"cannot reshape array of size (?P<size>\d+) into shape",
            translatable("The shape's numbers, multiplied, must be %(size)s."),
        ),
        (
            r"No \w+(?: sensor)? connected to.*\n.*[\"'](?P<port>(?:IN|OUT)PUT_\w)[\"']",
            translatable("%(port)s is the name of a port, not a text: write it without quotes."),
        ),
        (
            r"No motor connected to",
            translatable("The motors are on OUTPUT_B (left) and OUTPUT_C (right)."),
        ),
        (
            r"No color sensor connected to",
            translatable("The light sensors are on INPUT_2 (left) and INPUT_3 (right)."),
        ),
        (r"No ultrasonic sensor connected to", translatable("The ultrasonic sensor is on INPUT_1.")),
        (r"No gyro sensor connected to", translatable("The gyro sensor is on INPUT_4.")),
        (
            r"invalid (?:percentage|steering)|Invalid Speed Percentage",
            translatable("Choose a number from -100 to 100."),
        ),
        (r"^ModuleNotFoundError", translatable("Check its spelling, or submit the module's file beside your program.")),
        (
            r"^ValueError: negative seconds|sleep length must be non-negative",
            translatable("Wait for 0 seconds or more."),
        ),
        (
            r"^RecursionError",
            translatable("A function calls itself endlessly: use a loop, or return before it calls itself."),
        ),
        (
            r"^NameError: name '(?P<name>\w+)'",
            translatable(
                "Assign a value to %(name)s above this line, or correct its spelling. If it is a text, put it in "
                "quotes."
            ),
        ),
        (
            r"^TypeError: bad operand type for unary -: 'SpeedPercent'",
            translatable("Write the minus in the brackets, before the number: SpeedPercent(-40)."),
        ),
        (
            r"^TypeError: unsupported operand type\(s\) .*'SpeedPercent'",
            translatable("Calculate in the brackets: SpeedPercent(speed + steering)."),
        ),
        (
            r"^AttributeError: 'ColorSensor' object has no attribute",
            translatable(
                "Write reflected_light_intensity_pc for the light in percent, or color, color_name or rgb for the "
                "colour."
            ),
        ),
        (
            r"^AttributeError: 'UltrasonicSensor' object has no attribute",
            translatable("Write distance_centimeters for the distance."),
        ),
        (
            r"^AttributeError: 'GyroSensor' object has no attribute",
            translatable("Write angle for the direction in degrees."),
        ),
        (
            r"^AttributeError: 'Move(?:Tank|Steering)' object has no attribute '(?:position|speed|degrees|rotations)'",
            translatable("Each motor has its own: write tank_drive.left_motor.position, in degrees."),
        ),
        (
            r"^AttributeError: 'Move(?:Tank|Steering)' object has no attribute",
            translatable("It has on, off, on_for_seconds, on_for_rotations and on_for_degrees."),
        ),
        (
            r"^AttributeError: 'LargeMotor' object has no attribute",
            translatable("A motor has position, in degrees, and speed."),
        ),
        (
            r"^ValueError: Expected 2D array, got scalar array",
            translatable(
                "predict got a text or one number. Make an array of the image's pixels first, then .reshape(1, -1)."
            ),
        ),
        (
            r"invalid literal for int\(\) with base 10: '::?\s*-?\d",
            translatable(
                'The text still begins with a colon. Take all of the beginning off: text.removeprefix("PY::").'
            ),
        ),
        (
            r"invalid literal for int\(\) with base 10: '[^']*\d[^']*'",
            translatable(
                "The text contains more than the number: send the number alone, or remove the other words before int()."
            ),
        ),
        (
            r"'list' object has no attribute '(?:add|push|insert_end)'",
            translatable("To add a value to a list, write append(...)."),
        ),
        (r"module 'math' has no attribute 'PI'", translatable("Did you mean math.pi?")),
    )
)
