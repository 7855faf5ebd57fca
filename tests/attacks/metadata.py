"""What can be learnt without opening anything: names, sizes, times, and who else is there.

Some of it remains; docs/walls.md names it. No answer may ever be told by the name or the size of a file.
"""

from __future__ import annotations

import ctypes
import os
import sys
import sysconfig
import time

from attacks.tools import EITHER, REMAINS, SECCOMP, UNTRIED, attack, call, space, system_calls, targets

AT_FDCWD = -100


@attack(REMAINS)
def stat_the_key():
    return os.stat(targets.key).st_size


@attack(REMAINS)
def ask_whether_a_path_exists():
    return os.path.exists(targets.folder) and not os.path.exists(targets.folder + "-not")


@attack(REMAINS)
def ask_for_access():
    return os.access(targets.key, os.R_OK)


@attack(REMAINS)
def read_a_link():
    return os.readlink("/proc/self/exe")


@attack(REMAINS)
def list_names_of_packages():
    return os.listdir(sysconfig.get_path("purelib"))


@attack(REMAINS)
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


@attack(REMAINS)
def read_the_clock_of_another_process():
    clock = (~targets.victim << 3) | 2
    libc_time = ctypes.CDLL(None).clock_gettime
    return libc_time(ctypes.c_int(clock), space(16)) == 0


@attack(REMAINS)
def ask_whether_a_process_exists():
    return os.sched_getaffinity(targets.victim) and os.getpriority(os.PRIO_PROCESS, targets.victim) is not None


@attack(REMAINS)
def read_the_real_clock():
    return call("clock_gettime", time.CLOCK_REALTIME, space(16)) == 0


@attack(REMAINS)
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
