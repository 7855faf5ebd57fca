"""Submissions in every form, and malicious archives."""

from __future__ import annotations

import io
import os
import stat
import struct
import tracemalloc
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from responders.source_file import SourceFile
from sim.errors import UsageError
from submissions.assignment.definition import Parts
from submissions.bundle import read_submission
from submissions.notebook import read_notebook
from submissions.part_fitting import fit_parts
from submissions.raw_files import MAX_FILE_BYTES, MAX_FILES, read_zip_bytes
from submissions.stored_submission import pack_submission, unpack_submission
from submissions.student_names import normalise_name
from submissions.submission import Submission

pytestmark = pytest.mark.fast

PROGRAM = 'say("hello")\n'
RESPONDER = "def responder(text):\n    return text\n"
BOTH: dict[str, str | bytes] = {"robot.py": PROGRAM, "responder.py": RESPONDER}


def zipped(path: Path, files: Mapping[str, str | bytes] | Iterable[tuple[str | zipfile.ZipInfo, str | bytes]]) -> Path:
    entries = files.items() if isinstance(files, Mapping) else files
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return path


def folder(path: Path, files: Mapping[str, str | bytes]) -> Path:
    for name, data in files.items():
        file = path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def refusal(path: Path, required_parts: Parts | None = None) -> str:
    with pytest.raises(UsageError) as error:
        read_submission(path, required_parts=required_parts)
    sentence = str(error.value)
    assert "\n" not in sentence
    assert sentence.startswith(path.name)
    assert "expected" in sentence
    return sentence


def test_folder_and_zip_with_or_without_top_folder_are_the_same_submission(tmp_path: Path) -> None:
    files = {**BOTH, "net.joblib": b"\x80weights"}
    forms = [
        folder(tmp_path / "a", files),
        folder(tmp_path / "b", {f"week 5/{name}": data for name, data in files.items()}),
        zipped(tmp_path / "c.zip", files),
        zipped(tmp_path / "d.zip", {f"d/{name}": data for name, data in files.items()}),
        zipped(tmp_path / "e.ZIP", {f"e\\{name}": data for name, data in files.items()}),
    ]
    read = [read_submission(form) for form in forms]
    assert len({submission.sha256 for submission in read}) == 1
    assert [submission.student for submission in read] == ["a", "b", "c", "d", "e"]
    assert read[0].program == SourceFile("robot.py", PROGRAM)
    assert dict(read[0].files) == {"net.joblib": b"\x80weights"}
    assert read[1].notes == ("The files were read from the folder week 5 in it.",)


def test_leftovers_of_systems_are_ignored(tmp_path: Path) -> None:
    leftovers: dict[str, str | bytes] = {
        "__MACOSX/alice/._robot.py": b"\0",
        "alice/.DS_Store": b"\0",
        ".git/config": "x",
        "alice/__pycache__/robot.pyc": b"\0",
        "alice/desktop.ini": "x",
    }
    alice = {f"alice/{name}": text for name, text in BOTH.items()}
    assert not read_submission(zipped(tmp_path / "alice.zip", {**leftovers, **alice})).files
    assert not read_submission(folder(tmp_path / "alice", {**leftovers, **alice})).files


@pytest.mark.parametrize(
    ("name", "text", "part"),
    [
        ("alice.py", PROGRAM, "program"),
        ("alice.py", RESPONDER, "responder"),
        ("alice.py", "def echo_responder(m):\n    pass\n", "responder"),
        ("alice.py", "def f(m):\n    pass\n\nroboSim.pyresponder = f\n", "responder"),
        ("alice.py", 'print "PY::0"\n', "program"),
        ("responder.py", PROGRAM, "responder"),
        ("program.py", RESPONDER, "program"),
    ],
)
def test_lone_file_without_assignment_goes_by_name_then_by_text(
    tmp_path: Path, name: str, text: str, part: str
) -> None:
    (tmp_path / name).write_text(text)
    submission = read_submission(tmp_path / name)
    assert submission.program if part == "program" else submission.responder
    assert not (submission.responder if part == "program" else submission.program)
    assert submission.student == ("alice" if name == "alice.py" else tmp_path.name)


def test_lone_file_is_the_part_that_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "alice.py").write_text(PROGRAM)
    submission = read_submission(tmp_path / "alice.py", required_parts=Parts("robot.py", "student"))
    assert submission.responder == SourceFile("alice.py", PROGRAM)
    assert submission.program is None
    assert submission.notes == ("alice.py was used as a responder.",)


def test_two_files_of_any_name_are_told_apart(tmp_path: Path) -> None:
    submission = read_submission(folder(tmp_path / "x", {"mine.py": RESPONDER, "drive.py": PROGRAM}))
    assert submission.program == SourceFile("drive.py", PROGRAM)
    assert submission.responder == SourceFile("mine.py", RESPONDER)


def test_one_missing_part_of_two_is_named_and_the_other_taken(tmp_path: Path) -> None:
    path = folder(tmp_path / "bob", {"robot.py": PROGRAM, "my_responder.py": RESPONDER})
    submission = read_submission(path, required_parts=Parts())
    assert (submission.program, submission.responder) == (SourceFile("robot.py", PROGRAM), None)
    assert submission.notes == (
        "There is no responder.py (other files: my_responder.py); criteria that need a responder get no marks.",
    )
    lone = tmp_path / "eve.py"
    lone.write_text(RESPONDER)
    submission = read_submission(lone, required_parts=Parts())
    assert (submission.program, submission.responder) == (None, SourceFile("eve.py", RESPONDER))
    assert "There is no robot.py; criteria that need a robot program get no marks." in submission.notes


def test_without_any_part_that_is_asked_for_it_is_refused(tmp_path: Path) -> None:
    path = folder(tmp_path / "bob", {"robot.py": PROGRAM})
    assert "has no responder.py" in refusal(path, required_parts=Parts("robot.py", "student"))
    assert "has no robot.py or responder.py" in refusal(folder(tmp_path / "eve", {"a.txt": ""}), required_parts=Parts())


def test_part_that_the_assignment_gives_is_left_out_with_a_note() -> None:
    submitted = Submission("a", SourceFile("robot.py", PROGRAM), SourceFile("responder.py", RESPONDER))
    fitted = fit_parts(submitted, Parts("robot.py", "student"))
    assert fitted.program is None
    assert fitted.notes == ("robot.py was left out: the assignment does not need a robot program.",)


def test_a_note_does_not_name_the_students_folder(tmp_path: Path) -> None:
    path = folder(tmp_path / "Ada Lovelace_500000", {**BOTH, "notes.ipynb": "{"})
    (path / "responder.py").unlink()
    (note,) = read_submission(path).notes
    assert note.startswith("notes.ipynb: is not a notebook")


def test_submission_toml_names_the_assignment_and_not_the_student(tmp_path: Path) -> None:
    meta = 'assignment = "echo-responder"\nstudent = "Zoë\\u0007 Q"\n'
    path = folder(tmp_path / "json-queue" / "h1", {**BOTH, "submission.toml": meta})
    submission = read_submission(path)
    assert (submission.assignment, submission.student) == ("echo-responder", "h1")
    assert submission.notes == ("submission.toml names the student Zoë Q, which is not used.",)
    assert not submission.files
    assert read_submission(path, student="s1").student == "s1"
    (path / "submission.toml").unlink()
    assert read_submission(path).assignment == "json-queue"


@pytest.mark.parametrize("meta", ["assignment = 3\n", "assignment = \n", 'x = "' + "a" * 70_000 + '"', b"\xff\xfe\0"])
def test_submission_toml_that_cannot_be_used_is_refused(tmp_path: Path, meta: str | bytes) -> None:
    assert "submission.toml" in refusal(folder(tmp_path / "h", {**BOTH, "submission.toml": meta}))


@pytest.mark.parametrize(
    ("name", "clean"),
    [
        ("Ann\u202e\x1b[31m Li", "Ann[31m Li"),
        ("../../etc", "../../etc"),
        ("\n\t", ""),
        ("..", ""),
    ],
)
def test_student_names_are_cleaned(name: str, clean: str) -> None:
    assert normalise_name(name) == clean


@pytest.mark.parametrize(
    ("data", "text", "note"),
    [
        ("# café\n".encode(), "# café\n", ""),
        ("\ufeff# café\n".encode(), "# café\n", ""),
        ("# coding: cp1252\n# caf\u00e9 €\n".encode("cp1252"), "# coding: cp1252\n# café €\n", ""),
        ("#!x\n# -*- coding: koi8-r -*-\n# да\n".encode("koi8-r"), "#!x\n# -*- coding: koi8-r -*-\n# да\n", ""),
        ("# caf\u00e9\n".encode("latin-1"), "# café\n", "not UTF-8 (line 1)"),
        (b"# coding: rot13\n# abc\n", "# coding: rot13\n# abc\n", ""),
        (b"# coding: nonsense\nx = 1\n", "# coding: nonsense\nx = 1\n", ""),
        ("x = 1\n".encode("utf-16"), "x = 1\n", "UTF-16"),
    ],
)
def test_sources_are_read_in_the_encoding_they_have(tmp_path: Path, data: bytes, text: str, note: str) -> None:
    submission = read_submission(folder(tmp_path / "h", {"robot.py": data}))
    assert submission.program is not None
    assert submission.program.text == text
    assert note in " ".join(submission.notes)
    assert bool(note) == bool(submission.notes)


def test_nul_and_huge_sources_are_refused(tmp_path: Path) -> None:
    assert "NUL character in line 2" in refusal(folder(tmp_path / "a", {"robot.py": b"x = 1\ny\0\n"}) / "robot.py")
    sentence = refusal(folder(tmp_path / "b", {"robot.py": b"#" * 1_100_000}) / "robot.py")
    assert "at most 1 MB" in sentence


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    assert "does not exist" in refusal(tmp_path / "nobody.py")
    (tmp_path / "a.ipynb").write_text("{}")
    assert "notebook" in refusal(tmp_path / "a.ipynb")
    (tmp_path / "a.xyz").write_text("")
    assert "kind" in refusal(tmp_path / "a.xyz")
    (tmp_path / "empty").mkdir()
    assert "no files" in refusal(tmp_path / "empty")
    assert "no list of cells" in refusal(folder(tmp_path / "nb", {"a.ipynb": "{}"}))
    assert "found model.joblib" in refusal(folder(tmp_path / "m", {"model.joblib": b"x"}))
    assert "both program.py and robot.py" in refusal(
        folder(tmp_path / "two", {"robot.py": PROGRAM, "program.py": PROGRAM})
    )
    assert "folder sub" in refusal(folder(tmp_path / "nested", {"robot.py": PROGRAM, "sub/x.py": ""}))


@pytest.mark.parametrize(
    ("metadata", "sentence"),
    [
        ("1" * 5000, "lab.ipynb: has a number that is too long, expected a notebook as Jupyter saves it."),
        ("[" * 200 + "]" * 200, "lab.ipynb: is nested too deeply, expected a notebook as Jupyter saves it."),
    ],
    ids=["number", "depth"],
)
def test_the_reason_why_a_notebook_is_refused_is_the_right_one(metadata: str, sentence: str) -> None:
    with pytest.raises(UsageError) as refused:
        read_notebook(f'{{"cells": [], "metadata": {metadata}}}'.encode(), "lab.ipynb")
    assert str(refused.value) == sentence


def test_links_pipes_and_devices_in_folders_are_never_opened(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("do not read")
    path = folder(tmp_path / "h", BOTH)
    (path / "leak.txt").symlink_to(secret)
    (path / "etc").symlink_to("/etc")
    os.mkfifo(path / "pipe")
    submission = read_submission(path)
    assert not submission.files
    assert len(submission.notes) == 3
    (tmp_path / "link").symlink_to(path)
    assert "is a link" in refusal(tmp_path / "link")
    os.mkfifo(tmp_path / "robot.py")
    assert "not a regular file" in refusal(tmp_path / "robot.py")


def test_folder_caps(tmp_path: Path) -> None:
    path = folder(tmp_path / "big", BOTH)
    with (path / "x.bin").open("wb") as file:
        file.truncate(MAX_FILE_BYTES + 1)  # sparse: no disk is used
    assert "16 MB a file" in refusal(path)
    for part in range(3):
        with (path / f"x{part}.bin").open("wb") as file:
            file.truncate(MAX_FILE_BYTES - 1000)
    (path / "x.bin").unlink()
    assert "32 MB in all" in refusal(path)
    many = folder(tmp_path / "many", {**BOTH, **{f"f{number}": "" for number in range(MAX_FILES)}})
    assert f"at most {MAX_FILES}" in refusal(many)


def test_zip_with_paths_that_lead_elsewhere_is_refused(tmp_path: Path) -> None:
    for number, name in enumerate(
        ["../evil.py", "a/../../evil.py", "/etc/cron.d/x", "C:\\evil.py", "c:evil.py", "..\\evil.py", "\\\\host\\x"]
    ):
        path = zipped(tmp_path / f"{number}.zip", {**BOTH, name: "x"})
        assert "leads outside" in refusal(path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{number}.zip" for number in range(7)]


def entry(name: str, mode: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.create_system = 3
    info.external_attr = mode << 16
    return info


def test_zip_with_links_devices_nested_or_double_entries_is_refused(tmp_path: Path) -> None:
    link = zipped(tmp_path / "l.zip", [*BOTH.items(), (entry("x", stat.S_IFLNK | 0o777), "/etc/passwd")])
    assert "link" in refusal(link)
    device = zipped(tmp_path / "d.zip", [*BOTH.items(), (entry("x", stat.S_IFCHR | 0o666), "")])
    assert "not a file" in refusal(device)
    assert "a folder" in refusal(zipped(tmp_path / "n.zip", {**BOTH, "sub/x.py": ""}))
    assert "a folder" in refusal(zipped(tmp_path / "m.zip", {"top/robot.py": PROGRAM, "top/sub/x.py": ""}))
    with pytest.warns(UserWarning, match="Duplicate"):
        double = zipped(tmp_path / "t.zip", [*BOTH.items(), ("robot.py", "other")])
    assert "robot.py twice" in refusal(double)
    assert "cannot be used" in refusal(zipped(tmp_path / "c.zip", {**BOTH, "a\nb\x1b.txt": ""}))


def test_zip_that_is_empty_broken_or_no_zip_is_refused(tmp_path: Path) -> None:
    (tmp_path / "zero.zip").write_bytes(b"")
    assert "empty file" in refusal(tmp_path / "zero.zip")
    assert "no files in it" in refusal(zipped(tmp_path / "nothing.zip", {}))
    (tmp_path / "text.zip").write_text(PROGRAM)
    assert "not a zip archive" in refusal(tmp_path / "text.zip")
    whole = zipped(tmp_path / "whole.zip", BOTH).read_bytes()
    (tmp_path / "half.zip").write_bytes(whole[: len(whole) // 2])
    assert "not a zip archive" in refusal(tmp_path / "half.zip")
    (tmp_path / "flipped.zip").write_bytes(whole.replace(b"robot.py", b"robut.py", 1))
    assert "damaged" in refusal(tmp_path / "flipped.zip")
    with zipfile.ZipFile(tmp_path / "lzma.zip", "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("robot.py", PROGRAM)
    assert "unusual way" in refusal(tmp_path / "lzma.zip")


def test_encrypted_zip_is_refused(tmp_path: Path) -> None:
    data = bytearray(zipped(tmp_path / "e.zip", BOTH).read_bytes())
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.index(signature) + offset
        data[at] |= 1
    (tmp_path / "e.zip").write_bytes(data)
    assert "encrypted" in refusal(tmp_path / "e.zip")


def test_zip_bombs_are_stopped_while_they_unpack(tmp_path: Path) -> None:
    # 40 MB of zeros with a declared size of 10 bytes, then a file with the right size.
    zeros = b"\0" * (40 * 1024 * 1024)
    honest = zipped(tmp_path / "honest.zip", {**BOTH, "zeros.bin": zeros})
    assert "16 MB a file" in refusal(honest)
    spread = zipped(tmp_path / "spread.zip", {**BOTH, **{f"z{n}": zeros[: 15 * 1024 * 1024] for n in range(3)}})
    assert "32 MB in all" in refusal(spread)
    lying = bytearray(honest.read_bytes())
    at = lying.index(struct.pack("<I", len(zeros)))
    while at >= 0:
        lying[at : at + 4] = struct.pack("<I", 10)
        at = lying.find(struct.pack("<I", len(zeros)), at)
    (tmp_path / "lying.zip").write_bytes(lying)
    assert "zeros.bin" in refusal(tmp_path / "lying.zip")


@pytest.mark.long
def test_a_gigabyte_of_zeros_is_refused_without_being_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.writestr("robot.py", PROGRAM)
        with archive.open("zeros.bin", "w", force_zip64=True) as stream:
            for _ in range(1024):
                stream.write(b"\0" * (1024 * 1024))
    tracemalloc.start()
    try:
        assert "16 MB a file" in refusal(path)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak_bytes < 64 * 1024 * 1024


def test_zip_with_a_million_entries_is_refused_before_they_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "many.zip"
    path.write_bytes(zipped(tmp_path / "x.zip", BOTH).read_bytes() + b"PK\x01\x02" * 100_000)
    assert f"at most {MAX_FILES}" in refusal(path)


@given(st.data())
def test_no_broken_zip_raises_anything_but_a_sentence(data: st.DataObject) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in BOTH.items():
            archive.writestr(name, text)
    broken = bytearray(buffer.getvalue())
    for _ in range(data.draw(st.integers(1, 6))):
        broken[data.draw(st.integers(0, len(broken) - 1))] = data.draw(st.integers(0, 255))
    try:
        read_zip_bytes(bytes(broken), "x.zip")
        sentence = "x.zip: "
    except UsageError as error:
        sentence = str(error)
    assert sentence.startswith("x.zip: ")


texts = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=60)
names = st.from_regex(r"[a-z]{1,8}\.(joblib|txt|csv)", fullmatch=True)
sources = st.none() | st.builds(SourceFile, names.map(lambda name: name + ".py"), texts)


@given(
    st.builds(
        Submission,
        student=texts.map(normalise_name),
        program=sources,
        responder=sources,
        files=st.dictionaries(names, st.binary(max_size=40), max_size=3),
        assignment=st.none() | texts,
        notes=st.lists(texts, max_size=2).map(tuple),
    )
)
def test_packing_is_exact_and_always_the_same(submission: Submission) -> None:
    packed = pack_submission(submission)
    assert packed == pack_submission(submission)
    again = unpack_submission(packed)
    assert again == submission
    assert again.sha256 == submission.sha256


def test_packed_submission_can_be_submitted(tmp_path: Path) -> None:
    (tmp_path / "kept.zip").write_bytes(
        pack_submission(
            Submission("Zoë", SourceFile("z.py", PROGRAM), SourceFile("responder.py", RESPONDER), assignment="x")
        )
    )
    again = read_submission(tmp_path / "kept.zip")
    assert (again.student, again.assignment, again.program) == ("kept", "x", SourceFile("robot.py", PROGRAM))


def test_bytes_that_were_not_packed_here_are_refused() -> None:
    with pytest.raises(UsageError, match="stored submission"):
        unpack_submission(b"nonsense")
