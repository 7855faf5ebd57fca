"""Attacks that read or list files outside the student's folder, through every indirect path."""

from __future__ import annotations

import importlib
import os
import sys

from attacks.tools import (
    EITHER,
    LANDLOCK,
    attack,
    call,
    contents,
    libc,
    space,
    targets,
)

AT_FDCWD = -100
RENAME_EXCHANGE = 2
O_NEITHER = 3


@attack(LANDLOCK)
def read_the_password_file():
    return contents("/etc/passwd")


@attack(LANDLOCK)
def read_a_private_key_of_the_same_user():
    return contents(targets.ssh)


@attack(LANDLOCK)
def read_the_grading_key():
    return contents(targets.key)


@attack(LANDLOCK)
def read_the_key_through_libc():
    libc.fopen.restype = libc.fgets.restype = __import__("ctypes").c_void_p
    file = libc.fopen(targets.key.encode(), b"r")
    return file


@attack(LANDLOCK)
def read_the_key_by_system_call():
    return call("read", call("open", targets.key.encode(), 0), space(), 16) > 0


@attack(EITHER)
def read_the_key_with_openat2():
    how = (0).to_bytes(24, "little")
    return call("openat2", AT_FDCWD, targets.key.encode(), how, 24) > 0


@attack(LANDLOCK)
def read_the_key_as_a_numpy_memory_map():
    import numpy

    return numpy.memmap(targets.key, mode="r").tobytes()


@attack(LANDLOCK)
def read_the_key_with_dots():
    return contents(os.path.relpath(targets.key))


@attack(LANDLOCK)
def read_the_key_through_a_path_descriptor():
    """O_PATH needs no permission, and the descriptor can be opened again through /proc."""
    fd = os.open(targets.key, os.O_PATH)
    return contents(f"/proc/self/fd/{fd}")


@attack(LANDLOCK)
def read_the_key_beneath_a_path_descriptor():
    folder = os.open(targets.folder, os.O_PATH)
    return os.read(os.open("key", os.O_RDONLY, dir_fd=folder), 16)


@attack(LANDLOCK)
def read_the_key_through_proc_root():
    return contents("/proc/self/root" + targets.key)


@attack(LANDLOCK)
def read_the_key_through_proc_cwd():
    return contents(f"/proc/self/cwd/{os.path.relpath(targets.key)}")


@attack(EITHER)
def read_the_key_from_its_folder():
    os.chdir(targets.folder)
    return contents("key")


@attack(EITHER)
def read_the_key_through_a_symlink():
    os.symlink(targets.key, "link")
    return contents("link")


@attack(EITHER)
def read_the_key_through_a_hard_link():
    os.link(targets.key, "linked")
    return contents("linked")


@attack(EITHER)
def read_the_key_with_an_unpickled_model():
    import pickle

    class Model:
        def __reduce__(self):
            return os.system, (f"cat {targets.key} > stolen",)

    pickle.loads(pickle.dumps(Model()))
    return contents("stolen")


@attack(LANDLOCK)
def read_the_key_while_unpickling_with_joblib():
    import joblib

    class Model:
        def __reduce__(self):
            return contents, (targets.key,)

    joblib.dump(Model(), "model.joblib")
    return joblib.load("model.joblib")


@attack(EITHER)
def send_the_key_file_into_a_pipe():
    fd = os.open(targets.key, os.O_RDONLY)
    return os.copy_file_range(fd, os.open("copy", os.O_RDWR | os.O_CREAT), 16)


@attack(EITHER)
def send_file():
    fd = os.open(targets.key, os.O_RDONLY)
    return os.sendfile(os.pipe()[1], fd, 0, 16)


@attack(LANDLOCK)
def list_the_root():
    return os.listdir("/")


@attack(LANDLOCK)
def list_the_secrets():
    return os.listdir(targets.folder)


@attack(LANDLOCK)
def list_the_folder_that_folders_are_made_in():
    return os.listdir("..")


@attack(LANDLOCK)
def scan_by_system_call():
    return call("getdents64", call("open", targets.folder.encode(), os.O_DIRECTORY), space(4096), 4096) > 0


@attack(LANDLOCK)
def import_the_grader():
    return importlib.import_module("service.grading")


@attack(LANDLOCK)
def import_a_module_beside_the_key():
    sys.path.insert(0, targets.folder)
    return importlib.import_module("grader_secret")


@attack(LANDLOCK)
def read_the_sandboxs_own_source():
    return contents(sys.modules["inside.lockdown"].__file__)
