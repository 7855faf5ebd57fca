"""Attacks that pass a bit from one trial to another, of the same student or of an accomplice, repeatedly.

The first half of an attack leaves the bit. The second half looks for it in another child, later or at the same time.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import gc
import mmap
import os
import re
import resource
import select
import signal
import socket
import struct
import sys

from attacks.tools import (
    DOORKEEPER,
    LANDLOCK,
    NEWER,
    NOWHERE,
    SECCOMP,
    call,
    contents,
    leaves,
    libc,
    space,
    targets,
)

FADV_DONTNEED, MADV_PAGEOUT = 4, 21
FUTEX_WAIT, FUTEX_WAKE = 0, 1
KEY = 0x726D0000


def stay():
    """Signal that the bit is set, and keep it set until this process is ended."""
    sys.stdout.write(f"ready {os.getpid()}")
    while True:
        select.select([], [], [])


def touched(status):
    """Return whether a file was read or written since the first half of the attack began."""
    return max(status.st_atime, status.st_mtime) > targets.since


@leaves(DOORKEEPER)
def time_of_reading_a_file(turn, bit):
    if bit:
        contents(f"{targets.readable}/file-{turn}")


@time_of_reading_a_file.finds
def find_time_of_reading_a_file(turn):
    return touched(os.stat(f"{targets.readable}/file-{turn}"))


@leaves(DOORKEEPER)
def time_of_mapping_a_file(turn, bit):
    fd = os.open(f"{targets.readable}/file-{turn}", os.O_RDONLY)
    if bit:
        mmap.mmap(fd, 4096, prot=mmap.PROT_READ)[:1]


@time_of_mapping_a_file.finds
def find_time_of_mapping_a_file(turn):
    return touched(os.fstat(os.open(f"{targets.readable}/file-{turn}", os.O_RDONLY)))


@leaves(DOORKEEPER)
def time_of_listing_a_folder(turn, bit):
    if bit:
        os.listdir(f"{targets.readable}/folder-{turn}")


@time_of_listing_a_folder.finds
def find_time_of_listing_a_folder(turn):
    return touched(os.stat(f"{targets.readable}/folder-{turn}"))


@leaves(DOORKEEPER)
def time_of_following_a_link(turn, bit):
    if bit:
        os.path.exists(f"{targets.readable}/link-{turn}")


@time_of_following_a_link.finds
def find_time_of_following_a_link(turn):
    return touched(os.lstat(f"{targets.readable}/link-{turn}"))


@leaves(DOORKEEPER)
def time_of_following_a_link_elsewhere(turn, bit):
    """Follow a link to any place on the machine. A link can be followed without being readable."""
    if bit:
        os.path.exists(f"{targets.links}/link-{turn}")


@time_of_following_a_link_elsewhere.finds
def find_time_of_following_a_link_elsewhere(turn):
    return touched(os.lstat(f"{targets.links}/link-{turn}"))


@leaves(DOORKEEPER)
def time_of_being_refused_behind_a_link(turn, bit):
    """The kernel resolves the path to a file before it asks Landlock."""
    if bit:
        with contextlib.suppress(OSError):
            os.open(f"{targets.links}/link-{turn}/nothing", os.O_RDONLY)


@time_of_being_refused_behind_a_link.finds
def find_time_of_being_refused_behind_a_link(turn):
    return touched(os.fstat(os.open(f"{targets.links}/link-{turn}", os.O_PATH | os.O_NOFOLLOW)))


@leaves(DOORKEEPER)
def time_of_reading_a_link(turn, bit):
    if bit:
        os.readlink(f"{targets.links}/link-{turn}")


@time_of_reading_a_link.finds
def find_time_of_reading_a_link(turn):
    """Read the time with a less common system call that reports times."""
    found = space(256)
    call("statx", -100, f"{targets.links}/link-{turn}".encode(), 0x100, 0x7FF, found)
    seconds, nanoseconds = struct.unpack_from("=qI", found, 64)
    return seconds + nanoseconds / 1e9 > targets.since


@leaves(NOWHERE)
def time_of_using_a_device(turn, bit):
    if bit:
        contents("/dev/zero")
        contents("/dev/urandom")
        contents("/dev/null")


@time_of_using_a_device.finds
def find_time_of_using_a_device(turn):
    return any(touched(os.stat(f"/dev/{name}")) for name in ("zero", "urandom", "null"))


def resident(turn):
    """Return whether the page is in memory, for any process."""
    pages = mmap.mmap(os.open(f"{targets.readable}/pages-{turn}", os.O_RDONLY), 4096, prot=mmap.PROT_READ, flags=1)
    told = space(1)
    call("mincore", _address(pages), 4096, told)
    return told.raw[0] & 1


def _address(mapping):
    """Return the address of a read-only mapping."""
    buffer = space(80)
    ctypes.pythonapi.PyObject_GetBuffer(ctypes.py_object(mapping), buffer, 0)
    return struct.unpack_from("=Q", buffer)[0]


@leaves(SECCOMP)
def page_in_memory(turn, bit):
    if bit:
        contents(f"{targets.readable}/pages-{turn}")


@page_in_memory.finds
def find_page_in_memory(turn):
    return resident(turn)


@leaves(SECCOMP)
def page_counted_when_fetched(turn, bit):
    """Needs no clock: the kernel's count of pages read from disk is visible to all processes."""
    if bit:
        contents(f"{targets.readable}/pages-{turn}")


@page_counted_when_fetched.finds
def find_page_counted_when_fetched(turn):
    before = resource.getrusage(resource.RUSAGE_SELF)
    contents(f"{targets.readable}/pages-{turn}")
    after = resource.getrusage(resource.RUSAGE_SELF)
    return (after.ru_inblock, after.ru_majflt) == (before.ru_inblock, before.ru_majflt)


@leaves(SECCOMP)
def page_thrown_out(turn, bit):
    fd = os.open(f"{targets.readable}/pages-{turn}", os.O_RDONLY)
    os.read(fd, 64)
    if bit:
        os.posix_fadvise(fd, 0, 0, FADV_DONTNEED)


@page_thrown_out.finds
def find_page_thrown_out(turn):
    return resident(turn)


@leaves(SECCOMP)
def page_advised_out(turn, bit):
    pages = mmap.mmap(os.open(f"{targets.readable}/pages-{turn}", os.O_RDONLY), 4096, prot=mmap.PROT_READ, flags=1)
    pages[:1]
    if bit:
        pages.madvise(MADV_PAGEOUT)


@page_advised_out.finds
def find_page_advised_out(turn):
    return resident(turn)


@leaves(NOWHERE)
def the_zygotes_variables(turn, bit):
    """The zygote's last call returned how the previous child ended, and its frames are below ours on the stack."""
    os._exit(2 + bit)


@the_zygotes_variables.finds
def find_the_zygotes_variables(turn):
    frame = sys._getframe()
    while frame is not None:
        for value in frame.f_locals.values():
            if isinstance(value, resource.struct_rusage):
                return os.waitstatus_to_exitcode(frame.f_locals["status"]) == 3
        frame = frame.f_back
    return 0


@leaves(NOWHERE)
def the_zygotes_freed_memory(turn, bit):
    os._exit(10 + 2 * turn + bit)


@the_zygotes_freed_memory.finds
def find_the_zygotes_freed_memory(turn):
    """Find a number that no frame refers to any more, in a byte pattern that this search does not create itself."""
    number = re.compile(
        re.escape(struct.pack("=Q", id(int))) + b"[\1]\0{8}[\\x%02x]" % (11 + 2 * turn) + b"\0\0", re.DOTALL
    )
    return any(number.search(piece) for piece in _memory_of_objects())


def _memory_of_objects():
    """Yield the heap and every page that may contain Python objects. Unmapped pages are skipped without an error."""
    arenas = {id(each) >> 20 << 20 for each in gc.get_objects()}
    end = libc.sbrk(0)
    pages = {arena + step for arena in arenas for step in range(0, 1 << 20, 4096)} | set(
        range(end - (16 << 20), end, 4096)
    )
    fd = os.open("seen", os.O_RDWR | os.O_CREAT)
    for first, page in enumerate(sorted(pages)):
        if first % 1000 == 999:
            yield os.pread(fd, 1 << 22, 0)
            os.lseek(fd, 0, 0)
        libc.write(fd, ctypes.c_void_p(page), ctypes.c_size_t(4096))
    yield os.pread(fd, 1 << 22, 0)


libc.sbrk.restype = ctypes.c_long


@leaves(NOWHERE)
def number_of_an_own_file(turn, bit):
    for place in range(100 * bit):
        os.close(os.open(f"own-{place}", os.O_WRONLY | os.O_CREAT))


@number_of_an_own_file.finds
def find_number_of_an_own_file(turn):
    return os.fstat(os.open("own", os.O_WRONLY | os.O_CREAT)).st_ino


@leaves(NOWHERE)
def number_of_own_files(turn, bit):
    """Create and remove files until the inode number has the wanted value, where inode numbers keep increasing."""
    for _ in range(600):
        fd = os.open("own", os.O_WRONLY | os.O_CREAT)
        number = os.fstat(fd).st_ino & 255
        os.close(fd)
        os.unlink("own")
        if number in range(160, 164) if bit else number in range(32, 36):
            return


@number_of_own_files.finds
def find_number_of_own_files(turn):
    os.close(os.open("own", os.O_WRONLY | os.O_CREAT))
    return next(entry.inode() for entry in os.scandir() if entry.name == "own") & 255 >= 128


def _on_the_first_processor():
    """Move to the first processor, where both halves share the counter for inode numbers of anonymous files."""
    try:
        os.sched_setaffinity(0, {0})
    except OSError:
        for _ in range(10**6):
            if libc.sched_getcpu() == 0:
                return


@leaves(SECCOMP)
def number_of_a_pipe(turn, bit):
    _on_the_first_processor()
    for _ in range(3000):
        ends = os.pipe()
        number = os.fstat(ends[0]).st_ino & 1023
        os.close(ends[0])
        os.close(ends[1])
        if number in range(600, 640) if bit else number in range(90, 130):
            return


@number_of_a_pipe.finds
def find_number_of_a_pipe(turn):
    _on_the_first_processor()
    return os.fstat(os.pipe()[0]).st_ino & 1023 >= 512


@leaves(DOORKEEPER)
def number_of_what_the_kernel_shows(turn, bit):
    """The first lookup of an entry in /proc takes the next number of the same counter."""
    _on_the_first_processor()
    pages = mmap.mmap(-1, 1 << 23)
    start = ctypes.addressof(ctypes.c_char.from_buffer(pages))
    for page in range(start, start + (1 << 23), 8192):
        libc.mprotect(ctypes.c_void_p(page), ctypes.c_size_t(4096), 1)
    for page in range(start, start + (1 << 23) - 4096, 4096):
        number = os.lstat(f"/proc/self/map_files/{page:x}-{page + 4096:x}").st_ino & 1023
        if number in range(600, 640) if bit else number in range(90, 130):
            return


@number_of_what_the_kernel_shows.finds
def find_number_of_what_the_kernel_shows(turn):
    _on_the_first_processor()
    return os.lstat("/proc/self/timers").st_ino & 1023 >= 512


@leaves(LANDLOCK)
def file_in_shared_memory(turn, bit):
    if bit:
        os.close(os.open(f"/dev/shm/robomark-{turn}", os.O_WRONLY | os.O_CREAT))


@file_in_shared_memory.finds
def find_file_in_shared_memory(turn):
    try:
        os.unlink(f"/dev/shm/robomark-{turn}")
    except FileNotFoundError:
        return 0
    return 1


@leaves(SECCOMP)
def segment_of_shared_memory(turn, bit):
    if bit:
        call("shmget", KEY + turn, 4096, 0o1600)


@segment_of_shared_memory.finds
def find_segment_of_shared_memory(turn):
    try:
        segment = call("shmget", KEY + turn, 4096, 0)
    except FileNotFoundError:
        return 0
    return call("shmctl", segment, 0, 0) == 0


@leaves(SECCOMP)
def key_in_the_kernel(turn, bit):
    if bit:
        call("add_key", b"user", f"robomark-{turn}".encode(), b"x", 1, -4)


@key_in_the_kernel.finds
def find_key_in_the_kernel(turn):
    """Find the key in the user's keyring, which outlives all processes of the user."""
    try:
        key = call("keyctl", 10, -4, b"user", f"robomark-{turn}".encode(), 0)
    except OSError as error:
        if error.errno == 126:  # ENOKEY
            return 0
        raise
    return call("keyctl", 9, key, -4) == 0


@leaves(SECCOMP, at_once=True)
def lock_on_a_file(turn, bit):
    fd = os.open(f"{targets.readable}/file-{turn}", os.O_RDONLY)
    if bit:
        fcntl.flock(fd, fcntl.LOCK_EX)
    stay()


@lock_on_a_file.finds
def find_lock_on_a_file(turn):
    try:
        fcntl.flock(os.open(f"{targets.readable}/file-{turn}", os.O_RDONLY), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return 1
    return 0


@leaves(SECCOMP, at_once=True)
def lock_on_a_part_of_a_file(turn, bit):
    fd = os.open(f"{targets.readable}/file-{turn}", os.O_RDONLY)
    if bit:
        fcntl.lockf(fd, fcntl.LOCK_SH, 1)
    stay()


@lock_on_a_part_of_a_file.finds
def find_lock_on_a_part_of_a_file(turn):
    asked = struct.pack("=hhxxxxqqixxxx", fcntl.F_WRLCK, 0, 0, 1, 0)
    fd = os.open(f"{targets.readable}/file-{turn}", os.O_RDONLY)
    return struct.unpack_from("=h", fcntl.fcntl(fd, fcntl.F_GETLK, asked))[0] != fcntl.F_UNLCK


@leaves(SECCOMP, at_once=True)
def waiting_at_a_place_of_a_file(turn, bit):
    """Processes that map the same file can wait for each other at an offset, even if neither may write it."""
    pages = mmap.mmap(os.open(f"{targets.readable}/pages-{turn}", os.O_RDONLY), 4096, prot=mmap.PROT_READ, flags=1)
    sys.stdout.write(f"ready {os.getpid()}")
    if bit:
        value = struct.unpack_from("=i", pages)[0]
        while True:
            call("futex", _address(pages), FUTEX_WAIT, value, None)
    stay()


@waiting_at_a_place_of_a_file.finds
def find_waiting_at_a_place_of_a_file(turn):
    pages = mmap.mmap(os.open(f"{targets.readable}/pages-{turn}", os.O_RDONLY), 4096, prot=mmap.PROT_READ, flags=1)
    pages[:1]
    for _ in range(200):
        if call("futex", _address(pages), FUTEX_WAKE, 1):
            return 1
        select.select([], [], [], 0.001)
    return 0


@leaves(NOWHERE, at_once=True)
def signals_that_wait(turn, bit):
    """The number of pending signals is counted per user, not per process."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {40})
    for _ in range(5000 * bit):
        call("kill", os.getpid(), 40)
    stay()


@signals_that_wait.finds
def find_signals_that_wait(turn):
    """Signals beyond the limit are delivered at most once: count the deliveries for as many as a process may have."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {40})
    most = resource.getrlimit(resource.RLIMIT_SIGPENDING)[0]
    sent = min(most, 200_000)
    for _ in range(sent):
        call("kill", os.getpid(), 40)
    got = 0
    while True:
        try:
            call("rt_sigtimedwait", (1 << 39).to_bytes(8, "little"), space(128), bytes(16), 8)
        except OSError:
            return got <= sent - 5000
        got += 1


@leaves(SECCOMP, at_once=True)
def time_that_another_has_computed(turn, bit):
    if bit:
        sum(range(10**7))
    stay()


@time_that_another_has_computed.finds
def find_time_that_another_has_computed(turn):
    used = space(16)
    if libc.clock_gettime(ctypes.c_int((~targets.other << 3) | 2), used) != 0:
        raise OSError(ctypes.get_errno(), "clock_gettime")
    seconds, nanoseconds = struct.unpack("=qq", used)
    return seconds * 10**9 + nanoseconds


@leaves(DOORKEEPER, at_once=True)
def files_that_another_has_open(turn, bit):
    for _ in range(8 * bit):
        os.open("/dev/null", os.O_RDONLY)
    stay()


@files_that_another_has_open.finds
def find_files_that_another_has_open(turn):
    return os.stat(f"/proc/{targets.other}/fd").st_size


@leaves(NOWHERE, at_once=True)
def robust_list_of_another(turn, bit):
    call("set_robust_list", 1 << 20 << bit, 24)
    stay()


@robust_list_of_another.finds
def find_robust_list_of_another(turn):
    head = space(8)
    call("get_robust_list", targets.other, head, space(8))
    return int.from_bytes(head.raw, "little") == 1 << 21


@leaves(SECCOMP, at_once=True)
def priority_of_another(turn, bit):
    os.setpriority(os.PRIO_PROCESS, 0, 5 + bit)
    stay()


@priority_of_another.finds
def find_priority_of_another(turn):
    return os.getpriority(os.PRIO_PROCESS, targets.other)


@leaves(SECCOMP, at_once=True)
def limits_of_another(turn, bit):
    resource.setrlimit(resource.RLIMIT_NOFILE, (20 + bit, 32))
    stay()


@limits_of_another.finds
def find_limits_of_another(turn):
    return resource.prlimit(targets.other, resource.RLIMIT_NOFILE)[0]


@leaves(SECCOMP, at_once=True)
def processors_of_another(turn, bit):
    os.sched_setaffinity(0, {0} if bit else {0, 1})
    stay()


@processors_of_another.finds
def find_processors_of_another(turn):
    return len(os.sched_getaffinity(targets.other))


@leaves(LANDLOCK, at_once=True)
def name_of_another(turn, bit):
    libc.prctl(15, b"one" if bit else b"none", 0, 0, 0)
    stay()


@name_of_another.finds
def find_name_of_another(turn):
    return contents(f"/proc/{targets.other}/comm") == b"one\n"


@leaves(SECCOMP, at_once=True)
def memory_that_the_machine_shares(turn, bit):
    kept = mmap.mmap(-1, 180 << 20) if bit else b""
    for page in range(0, len(kept), 4096):
        kept[page] = 1
    stay()


@memory_that_the_machine_shares.finds
def find_memory_that_the_machine_shares(turn):
    found = space(256)
    call("sysinfo", found)
    return struct.unpack_from("=Q", found, 48)[0] >> 20


@leaves(NEWER, at_once=True)
def name_of_a_socket(turn, bit):
    if bit:
        server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        server.bind(f"\0robomark-{turn}")
        server.listen()
    stay()


@name_of_a_socket.finds
def find_name_of_a_socket(turn):
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        client.connect(f"\0robomark-{turn}")
    except ConnectionRefusedError:
        return 0
    return 1
