"""A process above the zygote that children have to ask about every path they name: only what they may read has one.

It opens nothing for them and protects no content, which is Landlock's: it keeps names, dates and numbers of files and
processes from them, in which one trial could leave something for another. Nothing is ever forked from it, as what it
is asked would be found in a fork.
"""

from __future__ import annotations

import array
import contextlib
import ctypes
import errno
import fcntl
import os
import select
import signal
import socket
import struct
from collections.abc import Iterable
from dataclasses import dataclass

from . import lockdown
from .system_calls import OPENS, PATHS

_RECEIVE, _SEND = 0xC0502100, 0xC0182101  # SECCOMP_IOCTL_NOTIF_RECV and _SEND
_QUESTION = struct.Struct("=QIIiIQ6Q")  # id, pid, flags, number, architecture, instruction, arguments
_ANSWER = struct.Struct("=QqiI")  # id, value, error, flags
_GO_ON = 1
_LONGEST = 4096
_FROM_HERE = -100  # AT_FDCWD
_PR_SET_PDEATHSIG = 1
#: How many files a child may make, even if it removes them again: it uses up numbers, which others could see.
_MOST_FILES = 300


@dataclass
class _Guest:
    """A child: where its questions come from, its memory, the folder it is in, and how many files it has made."""

    questions: int
    memory: int
    folder: bytes
    made: int = 0


def start(grants: lockdown.Grants, controls: Iterable[int]) -> socket.socket:
    """Stay behind as the doorkeeper, and go on in a fork: through the socket its children make themselves known.

    Whichever of the two ends takes the other along. The descriptors ``controls`` are the fork's alone.
    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    keeper = os.getpid()
    if os.fork() != 0:
        try:
            ours.close()
            for control in controls:
                os.close(control)
            _serve(theirs, _Known(grants))
        finally:
            os._exit(0)
    theirs.close()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != keeper:
        os._exit(0)
    return ours


def make_known(door: socket.socket, questions: int, memory: int) -> None:
    """Called in a child: from now on it is answered."""
    payload = array.array("i", [questions, memory])
    door.sendmsg([os.getcwdb()], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, payload)])


class _Known:
    """The paths that there are for children, as they are written and as they are with every link followed."""

    def __init__(self, grants: lockdown.Grants) -> None:
        self._beneath = {os.fsencode(path) for path in grants.read}
        self._exactly = {os.fsencode(path) for path in grants.list_only}
        for known in (self._beneath, self._exactly):
            known |= {os.path.realpath(path) for path in known}
        self._exactly |= {above for path in self._beneath | self._exactly for above in _above(path)}

    def has(self, path: bytes, folder: bytes) -> bool:
        """Whether a child in ``folder`` may name ``path``, and what it leads to."""
        parent, name = os.path.split(os.path.join(folder, path))
        itself = os.path.join(os.path.realpath(parent), name)
        if name in (b"", b".", b".."):
            itself = os.path.realpath(itself)
        target = os.path.realpath(itself) if os.path.islink(itself) else itself
        return self._has(itself, folder) and self._has(target, folder)

    def _has(self, path: bytes, folder: bytes) -> bool:
        above = _above(path)
        if path in self._exactly or path in self._beneath or not self._beneath.isdisjoint(above):
            return True
        return folder != b"/" and folder in (path, *above)


def _above(path: bytes) -> list[bytes]:
    found = []
    while path != (path := os.path.dirname(path)):
        found.append(path)
    return found


def _serve(door: socket.socket, known: _Known) -> None:
    """Answer until the zygote and its children are gone."""
    lockdown.forbid_new_privileges()
    with contextlib.suppress(lockdown.LayerMissing):
        # Not from the version that keeps signals in: that of its death has to reach the zygote.
        lockdown.restrict_files((), 5)
    guests: dict[int, _Guest] = {}
    poll = select.epoll()
    poll.register(door.fileno(), select.EPOLLIN)
    while True:
        for fd, event in poll.poll():
            if fd == door.fileno():
                guest = _new_guest(door)
                guests[guest.questions] = guest
                poll.register(guest.questions, select.EPOLLIN)
            elif event & select.EPOLLIN:
                with contextlib.suppress(OSError):  # it may be gone
                    _answer(guests[fd], known)
            else:
                gone = guests.pop(fd)
                os.close(gone.questions)
                os.close(gone.memory)


def _new_guest(door: socket.socket) -> _Guest:
    folder, ancillary, _, _ = door.recvmsg(_LONGEST, socket.CMSG_SPACE(2 * 4))
    if not folder:
        os.wait()
        os._exit(0)
    descriptors = array.array("i")
    for _, _, payload in ancillary:
        descriptors.frombytes(payload)
    questions, memory = descriptors
    return _Guest(questions, memory, folder)


def _answer(guest: _Guest, known: _Known) -> None:
    """The child waits, and has no second thread that could change the path before the kernel reads it again."""
    question = bytearray(_QUESTION.size)
    fcntl.ioctl(guest.questions, _RECEIVE, question)
    identity, _, _, number, _, _, *arguments = _QUESTION.unpack(question)
    try:
        error = _refusal(guest, known, number, arguments)
    except (OSError, OverflowError, ValueError):
        error = errno.EACCES
    answer = _ANSWER.pack(identity, 0, -error, 0 if error else _GO_ON)
    fcntl.ioctl(guest.questions, _SEND, answer)


def _refusal(guest: _Guest, known: _Known, number: int, arguments: list[int]) -> int:
    """The number of an error, or 0: what may not be named is not there, or may not be opened."""
    for start, place in PATHS[number]:
        path, end, _ = os.pread(guest.memory, _LONGEST, arguments[place]).partition(b"\0")
        if not end:
            return errno.ENAMETOOLONG
        from_here = start is None or ctypes.c_int(arguments[start]).value == _FROM_HERE
        # From a descriptor, which the child could open, nothing but a step up leads to what it could not.
        known_by_opening = not from_here and not path.startswith(b"/")
        if b".." in path.split(b"/") if known_by_opening else not known.has(path, guest.folder):
            return errno.EACCES if number in OPENS else errno.ENOENT
    flags = arguments[OPENS[number]] if number in OPENS else 0
    if flags & os.O_CREAT and not os.path.lexists(os.path.join(guest.folder, path)):
        guest.made += 1
    return errno.EDQUOT if guest.made > _MOST_FILES else 0
