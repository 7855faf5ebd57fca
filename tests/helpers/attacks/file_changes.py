"""Attacks on files and folders outside the student's own: change, replace, create, remove, and mount over them."""

from __future__ import annotations

import importlib
import json
import os
import socket
import stat
import sysconfig

from attacks.tools import (
    EITHER,
    LANDLOCK,
    NEWER,
    SECCOMP,
    UNTRIED,
    attack,
    call,
    libc,
    space,
    system_calls,
    targets,
)

AT_FDCWD = -100
RENAME_EXCHANGE = 2
O_NEITHER = 3


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
    """With both access bits set, a file is opened for neither reading nor writing, but O_TRUNC still empties it."""
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


@attack(EITHER)
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
    """Create a new file and remove it at once."""
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
    os.unlink(path)
    return fd > 0


@attack(UNTRIED)
def put_a_sitecustomize_into_the_packages():
    return _create(os.path.join(sysconfig.get_path("purelib"), "sitecustomize.py"))


@attack(UNTRIED)
def put_compiled_code_into_the_packages():
    return _create(os.path.join(sysconfig.get_path("purelib"), "robomark_decoy.pyc"))


@attack(UNTRIED)
def put_a_path_file_into_the_packages():
    return _create(os.path.join(sysconfig.get_path("purelib"), "robomark_decoy.pth"))


@attack(LANDLOCK)
def put_compiled_code_beside_the_key():
    return _create(os.path.join(targets.folder, "grader_secret.cpython-311.pyc"))


@attack(LANDLOCK)
def write_into_tmp():
    return _create(f"/tmp/robomark-decoy-{os.getpid()}")


@attack(LANDLOCK)
def write_into_shared_memory():
    return _create(f"/dev/shm/robomark-decoy-{os.getpid()}")


@attack(LANDLOCK)
def write_into_the_home_folder():
    return _create(os.path.join(os.path.dirname(targets.folder), f"decoy-{os.getpid()}"))


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


@attack(SECCOMP)
def leave_a_device_behind_when_renaming():
    rename_whiteout = 4
    open("here", "w").close()
    return call("renameat2", -100, b"here", -100, b"there", rename_whiteout) == 0


@attack(SECCOMP)
def create_a_program_that_changes_the_user():
    os.umask(0)
    return os.fstat(os.open("mine", os.O_CREAT | os.O_WRONLY, 0o6755)).st_mode & 0o6000


@attack(SECCOMP)
def create_a_program_that_changes_the_user_the_old_way():
    return call("open", b"mine-too", os.O_CREAT | os.O_WRONLY, 0o4755) >= 0
