"""Attacks on the kernel: unneeded system calls, foreign calling conventions and unassigned call numbers.

Calls that only root may make, or that could damage the machine, are tried in the full sandbox only.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import struct

from attacks.tools import (
    EITHER,
    SECCOMP,
    UNTRIED,
    attack,
    call,
    libc,
    machine_code,
    numbers,
    space,
    system_calls,
    targets,
)

X32 = 1 << 30
TIOCSTI, TIOCLINUX, TIOCSCTTY = 0x5412, 0x541C, 0x540E
MADV_HWPOISON, MADV_SOFT_OFFLINE = 100, 101
HIGH = 1 << 32


@attack(SECCOMP)
def call_as_32_bit_code():
    """mov eax, 20; int 0x80; ret: getpid of a 32-bit program."""
    return machine_code(b"\xb8\x14\0\0\0\xcd\x80\xc3") == os.getpid()


@attack(SECCOMP)
def make_a_socket_as_32_bit_code():
    """mov eax, 359; mov ebx, 1; mov ecx, 1; xor edx, edx; int 0x80, with rbx kept."""
    return machine_code(b"\x53\xb8\x67\x01\0\0\xbb\x01\0\0\0\xb9\x01\0\0\0\x31\xd2\xcd\x80\x5b\xc3") > 0


@attack(EITHER)
def open_as_32_bit_code():
    """Call open() as a 32-bit program, with a path below 4 GB."""
    page = mmap_low(targets.key.encode() + b"\0")
    code = b"\x53\xb8\x05\0\0\0\xbb" + struct.pack("=I", page) + b"\x31\xc9\x31\xd2\xcd\x80\x5b\xc3"
    return machine_code(code) >= 0


def mmap_low(data):
    map_32bit = 0x40
    address = libc.mmap(None, 4096, 3, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | map_32bit, -1, 0)
    ctypes.memmove(address, data, len(data))
    return address


@attack(UNTRIED)
def call_as_x32_code():
    return call(X32 + numbers["getpid"]) == os.getpid()


@attack(UNTRIED)
def open_as_x32_code():
    return call(X32 + numbers["open"], targets.key.encode(), 0) >= 0


@attack(UNTRIED)
def call_through_the_old_page():
    """Call gettimeofday on the vsyscall page. The kernel emulates it; the call is harmless, but the filter sees it."""
    old = ctypes.CFUNCTYPE(ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p)(0xFFFFFFFFFF600000)
    return old(None, None) == 0 and call("socket", 1, 1, 0) >= 0


@attack(UNTRIED)
def call_with_a_number_of_the_future():
    return any(_succeeds(number) for number in (*range(470, 600), 1000, 0x3FFFFFFF))


@attack(UNTRIED)
def call_with_a_negative_number():
    return any(_succeeds(number) for number in (-1, -2, -(1 << 31), (1 << 32) + 41, (1 << 63) + 41))


def _succeeds(number):
    try:
        return call(number, 1, 1, 0) >= 0
    except OSError:
        return False


@attack(UNTRIED)
def type_into_a_terminal():
    return any(libc.ioctl(fd, TIOCSTI, b"x") == 0 for fd in range(5))


@attack(UNTRIED)
def type_into_a_terminal_with_a_high_half():
    return call("ioctl", 0, TIOCSTI | HIGH, b"x") == 0


@attack(UNTRIED)
def take_a_terminal():
    return any(libc.ioctl(fd, request, 1) == 0 for fd in range(5) for request in (TIOCLINUX, TIOCSCTTY))


@attack(UNTRIED)
def poison_the_machines_memory():
    """Root can mark pages of memory as permanently unusable."""
    page = ctypes.c_void_p(libc.mmap(None, 4096, 3, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, -1, 0))
    return libc.madvise(page, 4096, MADV_SOFT_OFFLINE) == 0 or libc.madvise(page, 4096, MADV_HWPOISON) == 0


@attack(UNTRIED)
def take_down_the_sandbox():
    """Try to install a filter that allows everything. It must be refused."""
    allow_all = struct.pack("=HBBI", 6, 0, 0, 0x7FFF0000)
    buffer = ctypes.create_string_buffer(allow_all)
    header = struct.pack("=H6xQ", 1, ctypes.addressof(buffer))
    return call("seccomp", 1, 0, header) == 0


@attack(SECCOMP)
def listen_to_ones_own_system_calls():
    return call("seccomp", 2, 0, struct.pack("=I", 0x80000000)) == 0


@attack(UNTRIED)
def take_roots_powers():
    everything = b"\xff" * 12 * 2
    return call("capset", struct.pack("=Ii", 0x20080522, 0), everything) == 0


@attack(SECCOMP)
def change_user():
    return call("setuid", os.getuid()) == 0


@attack(UNTRIED)
def reboot():
    """Only query the action of Ctrl-Alt-Delete, with an invalid magic number."""
    return call("reboot", 0xFEE1DEAD, 0, 0, 0) == 0


@attack(UNTRIED)
def queue_messages():
    attributes = struct.pack("=qqqq", 0, 1, 8, 0) + bytes(32)
    call("mq_open", b"robomark-decoy", os.O_CREAT | os.O_RDWR, 0o600, attributes)
    call("mq_unlink", b"robomark-decoy")
    return True


@attack(SECCOMP)
def share_memory():
    number = call("shmget", 0, 4096, 0o600 | 0o1000)
    call("shmctl", number, 0, 0)
    return True


@attack(SECCOMP)
def share_semaphores():
    number = call("semget", 0, 1, 0o600 | 0o1000)
    call("semctl", number, 0, 0, 0)
    return True


@attack(SECCOMP)
def share_messages():
    number = call("msgget", 0, 0o600 | 0o1000)
    call("msgctl", number, 0, 0)
    return True


@attack(SECCOMP)
def splice_pages_into_a_pipe():
    buffer = space(4096)
    vector = struct.pack("=QQ", ctypes.addressof(buffer), 16)
    return call("vmsplice", os.pipe()[1], vector, 1, 0) > 0


@attack(SECCOMP)
def join_pipes():
    reading, writing = os.pipe()
    os.write(writing, b"x")
    return call("tee", reading, os.pipe()[1], 1, 0) > 0


@attack(UNTRIED)
def handle_page_faults():
    return call("userfaultfd", 0) >= 0


@attack(UNTRIED)
def read_the_kernels_clock_settings():
    return call("adjtimex", space(256)) >= 0


globals().update(
    system_calls(
        SECCOMP,
        add_key=(b"user", b"robomark-decoy", b"x", 1, -2),
        keyctl=(0, -2, 1),
        userfaultfd=(1,),
        memfd_secret=(0,),
        personality=(0,),
        modify_ldt=(0, space(64), 64),
        landlock_create_ruleset=(0, 0, 1),
        lsm_list_modules=(space(256), struct.pack("=I", 256), 0),
        set_mempolicy=(0, 0, 0),
        get_mempolicy=(0, 0, 0, 0, 0),
        sched_getattr=(0, space(64), 64, 0),
        sched_rr_get_interval=(0, space(16)),
        timerfd_create=(1, 0),
        signalfd4=(-1, bytes(8), 8, 0),
        munlockall=(),
        sync=(),
        setfsuid=(-1,),
        getgroups=(0, 0),
        getresuid=(space(8), space(8), space(8)),
    )
)
globals().update(
    {
        f"try_{name}": function
        for name, function in system_calls(
            UNTRIED,
            io_uring_setup=(1, space(256)),
            mlock=(0, 0),
            pkey_alloc=(0, 0),
            bpf=(0, bytes(64), 64),
            perf_event_open=(bytes(128), 0, -1, -1, 0),
            init_module=(b"", 0, b""),
            finit_module=(0, b"", 0),
            delete_module=(b"robomark_decoy", 0),
            kexec_load=(0, 0, 0, 0),
            iopl=(3,),
            ioperm=(0, 1, 1),
            clock_settime=(1, bytes(16)),
            settimeofday=(0, 0),
            clock_adjtime=(1, space(256)),
            sethostname=(b"robomark-decoy", -1),
            setdomainname=(b"robomark-decoy", -1),
            syslog=(3, space(), 256),
            migrate_pages=(0, 0, 0, 0),
            move_pages=(0, 0, 0, 0, 0, 0),
            mlockall=(1,),
            mlock2=(0, 0, 0),
            request_key=(b"user", b"robomark-decoy", 0, 0),
            vhangup=(),
            io_setup=(1, space(8)),
            io_uring_register=(0, 0, 0, 0),
            io_uring_enter=(0, 0, 0, 0, 0),
            futex_waitv=(0, 0, 0, 0, 0),
            landlock_restrict_self=(0, 0),
            landlock_add_rule=(0, 1, 0, 0),
            lsm_set_self_attr=(100, bytes(64), 64, 0),
            map_shadow_stack=(0, 4096, 0),
            remap_file_pages=(0, 0, 0, 0, 0),
            setgroups=(0, 0),
            setresuid=(0, 0, 0),
            setns=(0, 0),
            nfsservctl=(),
            ustat=(0, space()),
            waitid=(0, 0, 0, 4, 0),
        ).items()
    }
)
