"""Files that are not the student's: reading, changing, and every way round a path."""

from __future__ import annotations

import importlib
import json
import os
import socket
import stat
import sys
import sysconfig

from attacks.tools import (
    EITHER,
    LANDLOCK,
    NEWER,
    SECCOMP,
    UNTRIED,
    attack,
    call,
    contents,
    libc,
    space,
    system_calls,
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
    return contents(os.path.join("..", os.path.basename(targets.folder), "key"))


@attack(LANDLOCK)
def read_the_key_through_a_path_descriptor():
    """O_PATH needs no right; opening it again through /proc does."""
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
    return contents(f"/proc/self/cwd/../{os.path.basename(targets.folder)}/key")


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


@attack(LANDLOCK)
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
def read_the_walls_own_source():
    return contents(sys.modules["inside.lockdown"].__file__)


@attack(LANDLOCK)
def overwrite_the_key():
    return os.write(os.open(targets.key, os.O_WRONLY), b"mine")


@attack(LANDLOCK)
def append_to_the_key():
    return os.write(os.open(targets.key, os.O_WRONLY | os.O_APPEND), b"mine")


@attack(LANDLOCK)
def empty_the_key_by_opening_it_for_writing():
    return os.open(targets.key, os.O_WRONLY | os.O_TRUNC) > 0


@attack(NEWER)
def empty_the_key_by_opening_it_for_neither():
    """With both access bits set a file is opened for neither reading nor writing, and O_TRUNC empties it."""
    return call("open", targets.key.encode(), O_NEITHER | os.O_TRUNC, 0) > 0


@attack(NEWER)
def empty_the_key_by_opening_it_for_neither_at():
    return call("openat", AT_FDCWD, targets.key.encode(), O_NEITHER | os.O_TRUNC | 1 << 40, 0) > 0


@attack(NEWER)
def truncate_the_key():
    os.truncate(targets.key, 0)
    return True


@attack(EITHER)
def create_over_the_key():
    return call("creat", targets.key.encode(), 0o600) > 0


@attack(LANDLOCK)
def map_the_key_for_writing():
    import mmap

    return mmap.mmap(os.open(targets.key, os.O_RDWR), 4)


@attack(LANDLOCK)
def remove_the_key():
    os.unlink(targets.key)
    return True


@attack(EITHER)
def remove_the_secrets_folder():
    os.rmdir(os.path.join(targets.folder, "empty"))
    return True


@attack(LANDLOCK)
def rename_the_key_into_the_own_folder():
    os.rename(targets.key, "key")
    return True


@attack(LANDLOCK)
def rename_the_key_where_it_is():
    os.rename(targets.key, targets.key + ".old")
    return True


@attack(LANDLOCK)
def rename_a_file_over_the_key():
    os.close(os.open("mine", os.O_WRONLY | os.O_CREAT))
    os.rename("mine", targets.key)
    return True


@attack(LANDLOCK)
def swap_a_file_with_the_key():
    os.close(os.open("mine", os.O_WRONLY | os.O_CREAT))
    return call("renameat2", AT_FDCWD, b"mine", AT_FDCWD, targets.key.encode(), RENAME_EXCHANGE) == 0


@attack(LANDLOCK)
def create_a_file_among_the_secrets():
    return os.open(os.path.join(targets.folder, "mine"), os.O_WRONLY | os.O_CREAT) > 0


@attack(LANDLOCK)
def create_a_nameless_file_among_the_secrets():
    return os.open(targets.folder, os.O_WRONLY | os.O_TMPFILE) > 0


@attack(SECCOMP)
def change_the_mode_of_the_key():
    os.chmod(targets.key, 0o644)
    return True


@attack(SECCOMP)
def change_the_mode_of_the_key_at():
    return call("fchmodat", AT_FDCWD, targets.key.encode(), 0o644) == 0


@attack(SECCOMP)
def change_the_mode_of_the_key_at_2():
    return call("fchmodat2", AT_FDCWD, targets.key.encode(), 0o644, 0) == 0


@attack(SECCOMP)
def change_the_owner_of_the_key():
    os.chown(targets.key, os.getuid(), os.getgid())
    return True


@attack(SECCOMP)
def change_the_times_of_the_key():
    os.utime(targets.key, (1, 1))
    return True


@attack(SECCOMP)
def set_an_attribute_of_the_key():
    os.setxattr(targets.key, "user.mine", b"1")
    return True


@attack(EITHER)
def make_a_pipe_in_the_folder():
    os.mkfifo("pipe")
    return True


@attack(EITHER)
def make_a_folder_in_the_folder():
    os.mkdir("folder")
    return True


@attack(SECCOMP)
def make_a_node_for_a_file():
    os.mknod("node", 0o600 | stat.S_IFREG)
    return True


@attack(UNTRIED)
def make_a_device():
    os.mknod("device", 0o600 | stat.S_IFBLK, os.makedev(7, 0))
    return True


@attack(EITHER)
def bind_a_socket_in_the_folder():
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("socket")
        return True


@attack(SECCOMP)
def name_the_key_by_handle():
    handle = (128).to_bytes(4, "little") + bytes(260)
    return call("name_to_handle_at", AT_FDCWD, targets.key.encode(), handle, space(8), 0) == 0


@attack(LANDLOCK)
def write_into_the_standard_library():
    return os.open(json.__file__, os.O_WRONLY) > 0


@attack(LANDLOCK)
def write_into_the_brick():
    return os.open(importlib.import_module("brick_link").__file__, os.O_WRONLY) > 0


def _create(path):
    """A file that was not there; gone again at once."""
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
    os.unlink(path)
    return fd > 0


@attack(UNTRIED)
def put_a_sitecustomize_into_the_packages():
    return _create(os.path.join(sysconfig.get_path("purelib"), "sitecustomize.py"))


@attack(UNTRIED)
def put_compiled_code_into_the_packages():
    return _create(os.path.join(sysconfig.get_path("purelib"), "robomark_canary.pyc"))


@attack(UNTRIED)
def put_a_path_file_into_the_packages():
    return _create(os.path.join(sysconfig.get_path("purelib"), "robomark_canary.pth"))


@attack(LANDLOCK)
def put_compiled_code_beside_the_key():
    return _create(os.path.join(targets.folder, "grader_secret.cpython-311.pyc"))


@attack(LANDLOCK)
def write_into_tmp():
    return _create(f"/tmp/robomark-canary-{os.getpid()}")


@attack(LANDLOCK)
def write_into_shared_memory():
    return _create(f"/dev/shm/robomark-canary-{os.getpid()}")


@attack(LANDLOCK)
def write_into_the_home_folder():
    return _create(os.path.join(os.path.dirname(targets.folder), f"canary-{os.getpid()}"))


@attack(LANDLOCK)
def open_a_pseudo_terminal():
    return os.open("/dev/ptmx", os.O_RDWR | os.O_NOCTTY) > 0


@attack(LANDLOCK)
def open_the_kernels_settings_for_writing():
    return os.open("/proc/sys/kernel/core_pattern", os.O_WRONLY) > 0


@attack(LANDLOCK)
def open_the_control_groups():
    return os.listdir("/sys/fs/cgroup") is not None


@attack(UNTRIED)
def open_devices():
    for path in ("/dev/mem", "/dev/kmsg", "/dev/tty", "/dev/kvm", "/dev/fuse", "/dev/net/tun", "/proc/sysrq-trigger"):
        try:
            return os.open(path, os.O_RDWR) > 0
        except OSError:
            continue
    return False


@attack(UNTRIED)
def change_the_root():
    os.chroot(".")
    return True


@attack(UNTRIED)
def mount_something():
    return libc.mount(b"none", b".", b"tmpfs", 0, None) == 0


globals().update(
    system_calls(
        UNTRIED,
        open_by_handle_at=(AT_FDCWD, b"\0" * 64, 0),
        open_tree=(AT_FDCWD, b"/", 1),
        fsopen=(b"tmpfs", 0),
        fspick=(AT_FDCWD, b"/", 0),
        move_mount=(AT_FDCWD, b".", AT_FDCWD, b".", 0),
        pivot_root=(b".", b"."),
        umount2=(b"/proc", 2),
        swapon=(b"swap", 0),
        quotactl=(0x800002, b"", 0, 0),
        acct=(b"acct",),
        uselib=(b"lib",),
    )
)
