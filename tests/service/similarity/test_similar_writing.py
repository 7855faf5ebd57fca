"""Similar sources: disguised copies are found; given, widely shared and short sources are ignored."""

from __future__ import annotations

import time

import pytest

from benchmarks.harness.disguises import DISGUISES
from service.similarity import similar_sources
from service.similarity.similar_sources import SimilarSources, Source, SourceComparison, build_source, compare_sources
from service.similarity.sources import collect_given_code
from service.similarity.tokens import MAX_TOKENS, tokenise_source
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment


def example(assignment: str, name: str, file: str = "responder.py") -> str:
    return (locate_examples(assignment) / name / file).read_text(encoding="utf-8")


def of_two(one: str, other: str, given: tuple[str, ...] = ()) -> SourceComparison:
    return compare_sources(
        [build_source("ada", "responder.py", one), build_source("bob", "responder.py", other)], given
    )


def alike(comparison: SourceComparison) -> SimilarSources:
    assert comparison.too_short == ()
    (pair,) = comparison.alike
    return pair


def program(number: int, lines: int = 14) -> str:
    """Return a program unlike those of other numbers: all names that it calls are unique."""
    return "\n".join(
        f"motor_{number}.turn_{line}(speed) + sensor_{number}.read_{line}(not limit_{number})" for line in range(lines)
    )


@pytest.mark.parametrize("how", DISGUISES)
@pytest.mark.parametrize(
    ("assignment", "name"), [("rules-without-a-network", "reference"), ("shapes-on-a-track", "reference")]
)
def test_a_copy_is_found_however_it_is_disguised(how: str, assignment: str, name: str) -> None:
    text = example(assignment, name)
    pair = alike(of_two(text, DISGUISES[how](text), collect_given_code(find_assignment(assignment))))
    assert pair.students == ("ada", "bob")
    assert pair.share >= similar_sources.SIMILARITY_THRESHOLD


@pytest.mark.parametrize(
    ("assignment", "one", "other"),
    [
        ("digits-on-a-sheet", "reference", "learnt-by-heart"),
        ("rules-without-a-network", "reference", "looks-at-the-darkness"),
        ("shape-at-random", "reference", "rules"),
        ("shapes-on-the-move", "reference", "by-the-way-driven"),
    ],
)
def test_honest_solutions_of_one_assignment_are_not_alike(assignment: str, one: str, other: str) -> None:
    comparison = of_two(
        example(assignment, one), example(assignment, other), collect_given_code(find_assignment(assignment))
    )
    assert comparison == SourceComparison((), ())


def test_a_copied_part_of_a_larger_source_is_found() -> None:
    own = "\n".join(program(number, 12) for number in (1, 2, 3))
    pair = alike(of_two(program(4), f"{own}\n{program(4)}"))
    assert pair.shares[0] == 1
    assert pair.shares[1] < 0.5


def test_code_that_was_given_is_nobodys_copy() -> None:
    given, one, other = program(1), program(2), program(3)
    assert compare_sources(
        [build_source("ada", "a.py", f"{given}\n{one}"), build_source("bob", "a.py", f"{other}\n{given}")], [given]
    ) == SourceComparison((), ())
    # Too little code is left to compare, so there is no result for either.
    assert of_two(given, f"{given}\nspeed = 3", (given,)) == SourceComparison((), ("ada", "bob"))


def test_code_that_many_of_a_batch_share_is_nobodys_copy() -> None:
    shared = program(1)
    sources = [build_source(f"student {number}", "robot.py", f"{shared}\n{program(number)}") for number in range(2, 14)]
    assert compare_sources(sources, []).alike == ()
    few = [*sources, build_source("eve", "robot.py", program(2)), build_source("ivy", "robot.py", program(3))]
    assert {pair.students for pair in compare_sources(few, []).alike} == {("eve", "student 2"), ("ivy", "student 3")}


def test_two_files_of_one_student_are_not_compared() -> None:
    sources = [build_source("ada", "robot.py", program(1)), build_source("ada", "helper.py", program(1))]
    assert compare_sources(sources, []).alike == ()


def test_tables_of_numbers_are_not_alike() -> None:
    one, other = (
        f"{program(number)}\ntable = [\n" + "".join(f"    [{number}, {row}, 7],\n" for row in range(300)) + "]\n"
        for number in (1, 2)
    )
    assert of_two(one, other) == SourceComparison((), ())


def test_stretches_name_the_lines_of_both() -> None:
    text = program(1, 12)
    copy = f'"""Mine alone."""\n\nimport time\n\n# all my own work\n{text}\n'
    (stretch,) = alike(of_two(text, copy)).stretches
    assert (stretch.lines, stretch.other_lines) == ((1, 12), (6, 17))


def test_stretches_of_what_changed_places_point_crosswise() -> None:
    first, second = program(1, 10), program(2, 10)
    stretches = alike(of_two(f"{first}\n{second}", f"{second}\n{first}")).stretches
    assert [(each.lines, each.other_lines) for each in stretches] == [((1, 10), (11, 20)), ((11, 20), (1, 10))]


def test_names_numbers_texts_and_layout_do_not_count() -> None:
    one = "total = 0\nfor place in range(9):\n    total += read(place, 'left')\n"
    other = 't=1 # sum\nfor i in range(10) :\n\tt += read( i,\n  "right" )\n'
    assert tokenise_source(one).numbers.tolist() == tokenise_source(other).numbers.tolist()
    assert tokenise_source(one).numbers.tolist() != tokenise_source(one.replace("read", "write")).numbers.tolist()


@pytest.mark.long
@pytest.mark.parametrize(
    "text",
    [
        "",
        "x" * 1_000_000,
        "'" * 1_000_000,
        '"""' + '\\"""' * 200_000,
        "\\" * 1_000_000,
        "(" * 300_000 + ")" * 300_000,
        "((((" + "lambda x: " * 50_000,
        "a=" * 300_000,
        "1." * 500_000,
        "def f(:\n  <<<>>> ?? $ \x00 \ud800 ÄÖÜ\r\n" * 10_000,
        "f(a, b[1])\n" * 100_000,
    ],
    ids=lambda text: f"{text[:8]!r}",
)
def test_what_is_no_python_is_compared_too_and_nothing_hangs(text: str) -> None:
    began = time.process_time()
    comparison = of_two(text, text)
    assert len(tokenise_source(text)) <= MAX_TOKENS
    assert all(pair.share == 1 for pair in comparison.alike)
    assert time.process_time() - began < 20


def test_only_candidates_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[str] = []
    inner = similar_sources._compare_pair

    def counted(one: similar_sources._IndexedSource, other: similar_sources._IndexedSource) -> SimilarSources:
        compared.append(one.source.student)
        return inner(one, other)

    monkeypatch.setattr(similar_sources, "_compare_pair", counted)
    sources: list[Source] = [build_source(str(number), "robot.py", program(number)) for number in range(200)]
    comparison = compare_sources([*sources, build_source("eve", "robot.py", program(7))], [])
    assert [pair.students for pair in comparison.alike] == [("7", "eve")]
    assert len(compared) == 1


def test_of_too_many_pairs_those_with_most_in_common_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(similar_sources, "MAX_PAIRS", 2)
    half = f"{program(1)}\n{program(2)}"
    sources = [build_source("ada", "robot.py", program(1)), build_source("bob", "robot.py", half)]
    sources += [build_source(str(number), "robot.py", program(number)) for number in range(3, 18)]
    sources += [
        build_source("eve", "robot.py", program(3)),
        build_source("ivy", "robot.py", f"{program(4)}\n{program(5)}"),
    ]
    comparison = compare_sources(sources, [])
    assert (len(comparison.alike), comparison.not_compared) == (2, 2)


def test_a_file_that_groups_share_is_named_however_many_copied_it() -> None:
    """Five programs of six students each. Too much of each is common for any pair to have enough unique code."""
    shared = program(0, 12)
    sources = [
        build_source(f"s{number:02}", "robot.py", f"{shared}\n{program(number % 5, 3)}\n# no {number}")
        for number in range(30)
    ]
    comparison = compare_sources(sources, ())
    assert comparison.alike == ()
    assert comparison.same == tuple(tuple(f"s{number:02}" for number in range(first, 30, 5)) for first in range(5))
    assert comparison.too_short == ()
    assert compare_sources(sources, (shared, *(program(number, 3) for number in range(5)))).same == ()
    everybody = [build_source(f"s{number}", "robot.py", shared) for number in range(9)]
    assert compare_sources(everybody, ()).same == ()
