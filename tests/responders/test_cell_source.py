"""Syntax of IPython that Python lacks: magics, shell lines and questions, found only at the start of a statement."""

from __future__ import annotations

import ast

import pytest

from responders.sandbox.inside.cell_source import convert_to_python, expand_line, parse_cell_magic

MAGIC = "get_ipython().run_line_magic"


@pytest.mark.parametrize(
    ("cell", "python"),
    [
        ("%sim_magic -R -x {x}", f"{MAGIC}('sim_magic', '-R -x {{x}}')"),
        ("  %cat it's.txt  ", f"""  {MAGIC}('cat', "it's.txt")"""),
        ("df = %sim_data --clear", f"df = {MAGIC}('sim_data', '--clear')"),
        ("a, b[0] = %pair", f"a, b[0] = {MAGIC}('pair', '')"),
        ("!ls -l", "get_ipython().system('ls -l')"),
        ("!!ls", "get_ipython().getoutput('ls')"),
        ("names = !ls", "names = get_ipython().getoutput('ls')"),
        ("roboSim.image_data?", f"{MAGIC}('pinfo', 'roboSim.image_data')"),
        ("?roboSim", f"{MAGIC}('pinfo', 'roboSim')"),
        ("pip install numpy", f"{MAGIC}('pip', 'install numpy')"),
        ("%sim_magic -R \\\n  -x 5\nx = 1", f"{MAGIC}('sim_magic', '-R  -x 5')\n\nx = 1"),
        ("for i in 1, 2:\n    %sim_magic -x $i", f"for i in 1, 2:\n    {MAGIC}('sim_magic', '-x $i')"),
        ("x = 1 # it's\n%ls", f"x = 1 # it's\n{MAGIC}('ls', '')"),
    ],
)
def test_lines_that_become_calls(cell: str, python: str) -> None:
    assert convert_to_python(cell) == python
    assert python.count("\n") == cell.count("\n")
    ast.parse(python.strip())


@pytest.mark.parametrize(
    "cell",
    [
        "x = (7\n % 4)",
        "x = 7 \\\n % 4",
        "text = '''\n%cat\n!ls\nwhat?\n'''",
        'text = f"""\n%cat {x}\n"""',
        "x %= 3\nx = y != z\nx = a % b",
        "# what?\n#!ls\n# %cat",
        "s = 'it\\'s'\nt = \"(\"\nu = ')'",
        "d = {\n 'a': [\n%s\n]}" % 5,  # noqa: UP031
        "pip = 1",
    ],
)
def test_python_stays_as_it_is(cell: str) -> None:
    assert convert_to_python(cell) == cell


def test_a_magic_for_the_whole_cell() -> None:
    magic = parse_cell_magic("\n# mine\n%%sim_magic_preloaded -b Loop\nprint(1)\n")
    assert magic is not None
    assert (magic.name, magic.line, magic.body, magic.number) == ("sim_magic_preloaded", "-b Loop", "print(1)\n", 3)
    assert parse_cell_magic("x = 1\n%%bash\n") is None
    assert parse_cell_magic("%cat x") is None


def test_names_and_expressions_in_a_line() -> None:
    names = {"x": 5, "pose": type("P", (), {"y": 7})}
    assert expand_line("-x $x -y {x * 2} -a $pose.y", names) == "-x 5 -y 10 -a 7"
    assert expand_line("{x:03d} {{x}} $$x", names) == "005 {x} $x"
    for broken in ("-x $nobody", "{1 / 0}", "{x", "}"):
        assert expand_line(broken, names) == broken
