"""Attacks that learn facts without opening files: names, sizes, times, and other users' processes.

Some of these facts remain visible; docs/sandbox.md lists them.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import signal
import struct
import sys
import sysconfig
import time

from attacks.tools import (
    DOORKEEPER,
    EITHER,
    REMAINS,
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


@attack(DOORKEEPER)
def stat_the_key():
    return os.stat(targets.key).st_size


@attack(DOORKEEPER)
def ask_whether_a_path_exists():
    return os.path.exists(targets.folder) and not os.path.exists(targets.folder + "-not")


@attack(DOORKEEPER)
def ask_for_access():
    return os.access(targets.key, os.R_OK)


@attack(DOORKEEPER)
def read_a_link():
    return os.readlink("/proc/self/exe")


@attack(REMAINS)
def list_names_of_packages():
    return os.listdir(sysconfig.get_path("purelib"))


@attack(DOORKEEPER)
def open_a_path_descriptor():
    return os.fstat(os.open(targets.key, os.O_PATH)).st_size


@attack(REMAINS)
def name_the_working_folder():
    return os.getcwd()


@attack(REMAINS)
def name_the_machine():
    return os.uname().nodename


@attack(REMAINS)
def see_the_orders_of_the_zygote():
    return sys.argv[1:] and os.getppid()


@attack(SECCOMP)
def read_the_clock_of_another_process():
    clock = (~targets.victim << 3) | 2
    libc_time = ctypes.CDLL(None).clock_gettime
    return libc_time(ctypes.c_int(clock), space(16)) == 0


@attack(SECCOMP)
def ask_whether_a_process_exists():
    return os.sched_getaffinity(targets.victim) and os.getpriority(os.PRIO_PROCESS, targets.victim) is not None


@attack(DOORKEEPER)
def ask_whether_a_path_exists_by_how_it_is_refused():
    """A forbidden path and a missing path may be refused with different errors."""
    return _refused(targets.key) != _refused(targets.key + "-not")


@attack(DOORKEEPER)
def ask_whether_a_process_exists_by_how_it_is_refused():
    return _refused(f"/proc/{targets.victim}/environ") != _refused("/proc/4194304/environ")


@attack(DOORKEEPER)
def ask_whether_a_path_exists_by_removing_it():
    return _refused(targets.folder, os.unlink) != _refused(targets.folder + "-not", os.unlink)


@attack(DOORKEEPER)
def ask_whether_a_path_exists_by_renaming_it():
    return _refused(targets.folder, _rename) != _refused(targets.folder + "-not", _rename)


def _rename(path):
    """Rename to a name that exists, so that the call has no effect."""
    os.close(os.open("taken", os.O_WRONLY | os.O_CREAT))
    call("renameat2", AT_FDCWD, path.encode(), AT_FDCWD, b"taken", 1)


def _refused(path, attempt=lambda path: os.open(path, os.O_RDONLY)):
    try:
        attempt(path)
    except OSError as error:
        return error.errno
    return 0


@attack(DOORKEEPER)
def climb_to_the_key():
    """Climb from the student's folder upwards and down again to the key."""
    return os.stat("../" * 20 + targets.key).st_size


@attack(DOORKEEPER)
def climb_to_the_key_through_what_may_be_read():
    return os.stat(f"/usr/share/zoneinfo/{'../' * 5}{targets.key}").st_size


@attack(DOORKEEPER)
def climb_to_the_key_from_a_descriptor():
    folder = os.open("/usr/share/zoneinfo", os.O_RDONLY)
    return os.stat("../../../" + targets.key, dir_fd=folder).st_size


@attack(DOORKEEPER)
def name_the_key_by_the_own_process():
    return os.stat(f"/proc/self/root/{targets.key}").st_size


@attack(DOORKEEPER)
def stat_with_the_whole_path_beside_a_descriptor():
    """The flag selects the descriptor, but the kernel prefers a path if one is given."""
    found = space(256)
    call("newfstatat", os.open("/dev/null", os.O_RDONLY), targets.key.encode(), found, 0x1000)
    return int.from_bytes(found[48:56], "little") == len("the grading key")


@attack(DOORKEEPER)
def stat_a_path_at_the_end_of_a_page():
    """The path lies at the end of a page, so a check that reads a whole block of memory meets unmapped memory."""
    pages = mmap.mmap(-1, 8192)
    start = ctypes.addressof(ctypes.c_char.from_buffer(pages))
    libc.mprotect(ctypes.c_void_p(start + 4096), ctypes.c_size_t(4096), 0)
    path = targets.key.encode() + b"\0"
    ctypes.memmove(start + 4096 - len(path), path, len(path))
    found = space(256)
    call("stat", start + 4096 - len(path), found)
    return True


@attack(DOORKEEPER)
def change_the_path_after_it_was_looked_at():
    """A timer handler in machine code extends the path with a slash after the check, and removes the slash again."""
    path = ctypes.create_string_buffer(b"/usr/share/zoneinfo\0" + b"../" * 5 + targets.key.encode())
    place = ctypes.addressof(path) + len("/usr/share/zoneinfo")
    page = mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
    page.write(b"\x48\xb8" + struct.pack("=Q", place) + b"\x80\x30\x2f\xc3")  # xor byte [place], "/"; ret
    libc.signal.restype = ctypes.c_void_p
    libc.signal(signal.SIGALRM, ctypes.c_void_p(ctypes.addressof(ctypes.c_char.from_buffer(page))))
    signal.setitimer(signal.ITIMER_REAL, 1e-5, 5e-5)
    found, seen = space(256), False
    for _ in range(5000):
        seen |= libc.stat(path, found) == 0 and int.from_bytes(found[48:56], "little") == len("the grading key")
    signal.setitimer(signal.ITIMER_REAL, 0)
    return seen


@attack(REMAINS)
def read_the_real_clock():
    return call("clock_gettime", time.CLOCK_REALTIME, space(16)) == 0


@attack(SECCOMP)
def read_the_load_of_the_machine():
    return call("sysinfo", space(256)) == 0


@attack(SECCOMP)
def enter_the_secrets_folder():
    os.chdir(targets.folder)
    return True


@attack(SECCOMP)
def ask_how_full_the_disk_is():
    return os.statvfs("/")


@attack(SECCOMP)
def watch_the_secrets():
    return call("inotify_add_watch", call("inotify_init1", 0), targets.folder.encode(), 0xFFF) > 0


@attack(SECCOMP)
def list_attributes_of_the_key():
    return call("listxattr", targets.key.encode(), space(), 256) >= 0


@attack(EITHER)
def read_the_mounts():
    return call("statfs", b"/", space()) == 0 and os.read(os.open("/proc/self/mountinfo", os.O_RDONLY), 64)


globals().update(
    system_calls(
        UNTRIED,
        fanotify_init=(0, 0),
        lookup_dcookie=(0, space(), 256),
        listmount=(space(), space(), 16, 0),
        statmount=(space(), space(), 256, 0),
    )
)
