"""Attacks on other processes: their environment, memory and descriptors."""

from __future__ import annotations

import ctypes
import errno
import os
import resource

from attacks.tools import (
    DOORKEEPER,
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
    targets,
)

PTRACE_ATTACH, PTRACE_DETACH, PTRACE_SEIZE, PTRACE_TRACEME = 16, 17, 0x4206, 0


@attack(LANDLOCK)
def list_all_processes():
    return os.listdir("/proc")


@attack(UNTRIED)
def read_the_environment_of_the_first_process():
    return contents("/proc/1/environ")


@attack(LANDLOCK)
def read_the_environment_of_another():
    return contents(f"/proc/{targets.victim}/environ")


@attack(LANDLOCK)
def read_the_environment_of_the_worker():
    return contents(f"/proc/{targets.worker}/environ")


@attack(LANDLOCK)
def read_the_command_line_of_the_worker():
    return contents(f"/proc/{targets.worker}/cmdline")


@attack(UNTRIED)
def read_the_environment_of_the_zygote():
    return contents(f"/proc/{os.getppid()}/environ")


@attack(LANDLOCK)
def read_the_own_environment():
    return contents("/proc/self/environ")


@attack(LANDLOCK)
def read_the_own_memory_map():
    return contents("/proc/self/maps")


@attack(LANDLOCK)
def list_the_own_descriptors():
    return os.listdir("/proc/self/fd")


@attack(LANDLOCK)
def write_the_own_memory():
    return os.open("/proc/self/mem", os.O_RDWR) > 0


@attack(LANDLOCK)
def read_the_own_status():
    return contents("/proc/thread-self/status")


@attack(LANDLOCK)
def open_the_memory_of_another():
    return os.open(f"/proc/{targets.victim}/mem", os.O_RDONLY) > 0


@attack(LANDLOCK)
def open_the_memory_of_the_worker():
    return os.open(f"/proc/{targets.worker}/mem", os.O_RDONLY) > 0


@attack(UNTRIED)
def open_the_memory_of_the_zygote():
    return os.open(f"/proc/{os.getppid()}/mem", os.O_RDWR) > 0


@attack(LANDLOCK)
def open_a_descriptor_of_another():
    return os.open(f"/proc/{targets.victim}/fd/0", os.O_RDONLY) > 0


@attack(LANDLOCK)
def enter_the_root_of_another():
    return os.listdir(f"/proc/{targets.victim}/root/")


@attack(LANDLOCK)
def choose_who_dies_when_memory_runs_out():
    return os.open("/proc/self/oom_score_adj", os.O_WRONLY) > 0


@attack(EITHER)
def compare_with_another():
    return call("kcmp", os.getpid(), targets.victim, 0, 0, 0) >= 0


@attack(EITHER)
def steal_a_descriptor():
    return call("pidfd_getfd", call("pidfd_open", targets.victim, 0), 0, 0) >= 0


@attack(SECCOMP)
def get_a_handle_of_another():
    return call("pidfd_open", targets.victim, 0) >= 0


@attack(EITHER)
def read_the_memory_of_another():
    return _reaches_memory(libc.process_vm_readv)


@attack(EITHER)
def write_the_memory_of_another():
    return _reaches_memory(libc.process_vm_writev)


def _reaches_memory(function):
    """Use an invalid address: only callers with permission get the error for it."""

    class Vector(ctypes.Structure):
        _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))

    own = space(64)
    local, remote = Vector(ctypes.addressof(own), 8), Vector(4096, 8)
    got = function(targets.victim, ctypes.byref(local), 1, ctypes.byref(remote), 1, 0)
    return got < 0 and ctypes.get_errno() == errno.EFAULT


@attack(EITHER)
def trace_another():
    call("ptrace", PTRACE_SEIZE, targets.victim, 0, 0)
    return True


@attack(UNTRIED)
def trace_the_zygote():
    call("ptrace", PTRACE_SEIZE, os.getppid(), 0, 0)
    return True


@attack(UNTRIED)
def attach_to_the_worker():
    call("ptrace", PTRACE_ATTACH, targets.worker, 0, 0)
    return True


@attack(NEWER)
def be_traced_by_the_zygote():
    return call("ptrace", PTRACE_TRACEME, 0, 0, 0) == 0


@attack(UNTRIED)
def advise_on_the_memory_of_another():
    fd = call("pidfd_open", targets.victim, 0)
    return call("process_madvise", fd, space(16), 1, 21, 0) >= 0


@attack(UNTRIED)
def release_the_memory_of_another():
    return call("process_mrelease", call("pidfd_open", targets.victim, 0), 0) >= 0


@attack(UNTRIED)
def enter_the_namespaces_of_the_first_process():
    return call("setns", os.open("/proc/1/ns/mnt", os.O_RDONLY), 0) >= 0


@attack(SECCOMP)
def make_namespaces():
    return call("unshare", 0x10000000) >= 0  # CLONE_NEWUSER


@attack(UNTRIED)
def make_namespaces_with_clone():
    return call("clone", 0x10000000 | 17, 0, 0, 0, 0) > 0


@attack(DOORKEEPER)
def count_the_files_of_another():
    """The size of a folder that must not be listed is the number of open files."""
    return os.stat(f"/proc/{targets.victim}/fd").st_size


@attack(DOORKEEPER)
def count_all_processes():
    return os.stat("/proc").st_nlink


@attack(DOORKEEPER)
def see_whose_process_it_is():
    return os.stat(f"/proc/{targets.victim}").st_ino


@attack(LANDLOCK)
def follow_the_program_of_another():
    return os.readlink(f"/proc/{targets.victim}/exe")


@attack(DOORKEEPER)
def see_the_own_program_and_descriptors():
    return os.readlink("/proc/self/exe") and os.readlink("/proc/self/fd/3")


@attack(SECCOMP)
def read_the_limits_of_another():
    return resource.prlimit(targets.victim, resource.RLIMIT_NOFILE)


@attack(SECCOMP)
def read_the_scheduler_of_another():
    return call("sched_getscheduler", targets.victim) >= 0


@attack(SECCOMP)
def read_the_parameters_of_another():
    return call("sched_getparam", targets.victim, space(8)) == 0


@attack(SECCOMP)
def read_the_session_of_another():
    return call("getsid", targets.victim) > 0


@attack(SECCOMP)
def read_the_lowest_priority_of_all_own():
    """Return the lowest priority of all processes of this user."""
    return call("getpriority", 2, 0) > 0


@attack(SECCOMP)
def sleep_by_the_clock_of_another():
    clock = (~targets.victim << 3) | 2
    return libc.clock_getres(ctypes.c_int(clock), space(16)) == 0


@attack(SECCOMP)
def read_the_processors_of_another():
    return call("sched_getaffinity", targets.victim, 128, space(128)) > 0


@attack(SECCOMP)
def read_the_limits_of_another_with_a_high_half():
    return call("prlimit64", targets.victim | 1 << 32, 7, 0, space(16)) == 0
