"""Mutants: each has one fault at the stated place, and the same text always gives the same mutants."""

from __future__ import annotations

import ast
import re
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.mutation.mutants import iterate_mutants, make_mutants
from service.mutation.source_tree import SourceTree
from sim.errors import UsageError
from submissions.assignment.examples import locate_examples
from submissions.assignment.folder import list_catalogue_ids
from submissions.magics import comment_out_magic
from submissions.submission import Part

pytestmark = pytest.mark.fast

#: Simple statements with tabs, letters of several bytes, f-strings and line breaks. Each is complete by itself.
_STATEMENTS = (
    "x = 40",
    "größe = -1.6  # Größe in Umdrehungen < 3",
    "tank_drive.on(SpeedPercent(40),\tSpeedPercent( -30 ))",
    "time.sleep(1) ; x = x + 1",
    "s = f'é {x + 1:>{größe}} ä', 7",
    's = f"""{1}\n{1} ü""" + str(1)',
    "t = ('日本', 'ß'\n    'c',  # 5 'é'\n\t'd')[\n  0 ]",
    "y = (x  # < 3, not this\n  <= 3 and not größe)",
    "q['schlüssel'] = {'ü': 'a', \"größe\": 'b'}[k]",
    "x = colorLeft.reflected_light_intensity_pc - (40)if größe else(3)",
    'r = """\n\tüber\n""" \\\n  + "a"',
    "x -= - 5",
    "pass",
)
_HEADS = ("while x > 3:", "if (größe\n  == 2):", "for i in range( 4 ):", "def responder( text ):\n    return 'ä', text")


@st.composite
def _sources(draw: st.DrawFn) -> str:
    lines: list[str] = list(draw(st.sampled_from([(), ("# 1 ä",), ("%%sim_magic -b Loop -x 40", "")])))
    for _ in range(draw(st.integers(1, 3))):
        statements = draw(st.lists(st.sampled_from(_STATEMENTS), min_size=1, max_size=3))
        if draw(st.booleans()):
            lines.append(draw(st.sampled_from(_HEADS)))
            indent = "    " if "return" in lines[-1] else draw(st.sampled_from(["\t", "  "]))
            statements = [f"{indent}{each}" for each in statements]
        lines += statements
    return draw(st.sampled_from(["\n", "\r\n"])).join(lines) + "\n"


def _dump(text: str) -> str:
    return ast.dump(ast.parse(comment_out_magic(text)))


@settings(max_examples=20)
@given(_sources(), st.sampled_from(["program", "responder"]))
def test_each_mutant_differs_in_one_place(text: str, part: Part) -> None:
    sources = [text]
    for mutant in iterate_mutants(text, part):
        end = mutant.start + len(mutant.old)
        before, after = text[: mutant.start], text[end:]
        assert text[mutant.start : end] == mutant.old
        assert mutant.source.startswith(before)
        assert mutant.source.endswith(after)
        changed = mutant.source[len(before) : len(mutant.source) - len(after)]
        assert changed.strip(" ") == mutant.new.strip(" ")
        assert mutant.line == 1 + len(re.findall(r"\r\n|\r|\n", before))
        assert _dump(mutant.source) != _dump(text) or mutant.operator == "swapped statements"
        sources.append(mutant.source)
    assert len(set(sources)) == len(sources)


@settings(max_examples=20)
@given(_sources())
def test_each_node_is_found_where_it_is(text: str) -> None:
    tree = SourceTree(text)
    for node in tree.nodes:
        if isinstance(node, ast.expr) and not isinstance(getattr(node, "ctx", ast.Load()), ast.Store | ast.Del):
            assert ast.dump(ast.parse(f"({tree.cut(node)})", mode="eval").body) == ast.dump(node)
    values = [ast.literal_eval(tree.text[each.start : each.end].replace(" ", "")) for each in tree.numbers]
    assert values == [each.value for each in tree.numbers]


@pytest.mark.parametrize(
    ("operator", "part", "text", "expected"),
    [
        ("larger number", "program", "x = 40\n", ["x = 60\n"]),
        ("larger number", "program", "x = [0, 1, -1, 1.6]\n", ["[1,", "0, 2, -1,", "1, -2, 1.6", "2.4"]),
        ("smaller number", "program", "x = [0, 1, -4, 0.3]\n", ["[0, 0,", "-2,", "0.2]"]),
        ("sign", "program", "x = a[1] - 2\n", ["a[1] - -2", "a[1] + 2"]),
        ("comparison", "program", "while x>=5 < y: pass\n", ["x<=5 <", "x>5 <", "5 > y", "5 <= y"]),
        ("condition", "program", "while not x: x = a or b\n", ["while (x):", "a and b"]),
        ("condition", "program", "if x: x = True\n", ["if (not (x)):", "= False"]),
        ("dropped statement", "program", '"""Doc."""\nx = 1; f(x)\nsleep(1)\n', ["\npass; f", "1; pass\n"]),
        ("swapped statements", "program", "a()  # first\nb()\nb()\n", ["b()  # first\na()\nb()"]),
        ("while and if", "program", "while x:\n  if y: a()\n", ["if x:\n", "while y:"]),
        ("while and if", "program", "while x:\n  if y: break\n", ["while y:"]),
        ("while and if", "program", "while x:\n  for i in y: break\n", ["if x:"]),
        ("while and if", "program", "if x: pass\nelif y: pass\n", []),
        ("off by one", "program", "for i in range(2, n): a[i + 1], a[0:-1]\n", ["range(3", "a[1:", ":0]", "(n) - 1"]),
        ("port", "program", "m = MoveTank(OUTPUT_B, 'outC')\n", ["(OUTPUT_C, 'outC')", "(OUTPUT_B, 'outB')"]),
        ("port", "program", "t.on(1, 2); x['left'], colorRight, 'left'\n", ["(2, 1)", "['right']", "colorLeft"]),
        ("wait removed", "program", "while True:\n\ttime.sleep(0.1)\n", ["True:\n\tpass\n"]),
        ("wrong unit", "program", "m.on_for_rotations(1, 2, 3); sleep(0.5)\n", ["m.on_for_degrees(1", "sleep(500)"]),
        ("label swapped", "responder", "N = ['a', 'a', 'ß']\nx = 'l' if y else 'r'\n", ["'a', 'ß', 'a'", "'r' if y"]),
        ("label swapped", "responder", "N = {1: 'a', 2: 'b'}\n", ["{1: 'b', 2: 'a'}"]),
        ("none", "responder", "def f(x):\n  if x: return\n  return(x)\n", ["return(None)"]),
        ("wrong key", "responder", "x = {'a': 1}['b']; x.get(\"c\"), x[0]\n", ["['bs']", "{'as':", '("cs")']),
        ("wrong type", "responder", "def f(x):\n  return int(x)\n", ["return [int(x)]", "return str(x)"]),
        (
            "state lost",
            "responder",
            "seen = []\nn = 0\ndef f(x):\n  global n\n  y = []\n  n += 1\n  seen.append(x)\n  y.append(x)\n  x = n\n",
            ["\n  pass\n  seen", "\n  pass\n  y"],
        ),
    ],
)  # fmt: skip
def test_an_operator_makes_its_faults(operator: str, part: Part, text: str, expected: list[str]) -> None:
    sources = [each.source for each in iterate_mutants(text, part) if each.operator == operator]
    assert len(sources) == len(expected)
    for source, piece in zip(sources, expected, strict=True):
        assert piece in source
        assert piece not in text


def test_mutants_are_spread_over_operators_and_lines() -> None:
    text = "".join(f"tank_drive.on({n}, {n + 1})\nif x > {n}:\n    time.sleep({n})\n" for n in range(1, 6))
    mutants = make_mutants(text, "program", 30)
    assert mutants == make_mutants(text, "program", 30)
    assert len(mutants) == 30
    assert [each.line for each in mutants] == sorted(each.line for each in mutants)
    assert len({each.operator for each in mutants}) >= 9
    assert max(Counter(each.line for each in mutants).values()) <= 3
    assert set(make_mutants(text, "program", 10)) < set(make_mutants(text, "program", 500))


def test_a_text_that_is_not_python_has_no_mutants() -> None:
    with pytest.raises(UsageError, match="line 2 is not Python"):
        make_mutants("x = 1\ny = = 2\n", "program", 5)


def test_references_have_mutants() -> None:
    for name in list_catalogue_ids()[::5]:
        for path in sorted((locate_examples(name) / "reference").glob("*.py")):
            part: Part = "program" if path.name.startswith("robot") else "responder"
            assert make_mutants(path.read_text("utf-8"), part, 5), path
