"""The doorkeeper: a process above the zygote that decides about each path in a child's system calls.

It opens no files for children and does not protect content, which Landlock does. It hides names, dates and inode
numbers of files and processes, in which one trial could leave data for another. Nothing is ever forked from it, because
a fork would contain the paths of earlier requests.
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
from .system_calls import FLAG_ARGUMENTS, PATH_ARGUMENTS

_RECEIVE, _SEND = 0xC0502100, 0xC0182101  # SECCOMP_IOCTL_NOTIF_RECV and _SEND
_QUESTION = struct.Struct("=QIIiIQ6Q")  # id, pid, flags, number, architecture, instruction, arguments
_ANSWER = struct.Struct("=QqiI")  # id, value, error, flags
_CONTINUE = 1
_MAX_PATH_LENGTH = 4096
_CURRENT_FOLDER = -100  # AT_FDCWD
_PR_SET_PDEATHSIG = 1
#: Maximum number of files a child may create, including deleted ones, because inode numbers are visible to others.
_MAX_FILES = 300


@dataclass
class _RegisteredChild:
    """A child: the descriptor of its requests, its memory, its folder, and how many files it has created."""

    requests: int
    memory: int
    folder: bytes
    created_files: int = 0


def start_doorkeeper(grants: lockdown.Grants, controls: Iterable[int]) -> socket.socket:
    """Become the doorkeeper, and continue in a fork. Return the socket on which children register.

    When either of the two ends, so does the other. Only the fork keeps the descriptors ``controls``.
    """
    zygote_end, keeper_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    keeper_pid = os.getpid()
    if os.fork() != 0:
        try:
            zygote_end.close()
            for control in controls:
                os.close(control)
            _serve_requests(keeper_end, _KnownPaths(grants))
        finally:
            os._exit(0)
    keeper_end.close()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != keeper_pid:
        os._exit(0)
    return zygote_end


def register_child(door: socket.socket, questions: int, memory: int) -> None:
    """Register this child with the doorkeeper, which answers its requests from now on."""
    payload = array.array("i", [questions, memory])
    door.sendmsg([os.getcwdb()], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, payload)])


class _KnownPaths:
    """The paths that children may name, as written and with all links resolved."""

    def __init__(self, grants: lockdown.Grants) -> None:
        self._beneath = {os.fsencode(path) for path in grants.read}
        self._exactly = {os.fsencode(path) for path in grants.list_only}
        for paths in (self._beneath, self._exactly):
            paths |= {os.path.realpath(path) for path in paths}
        self._exactly |= {above for path in self._beneath | self._exactly for above in _list_parent_folders(path)}

    def has(self, path: bytes, folder: bytes) -> bool:
        """Return whether a child in ``folder`` may name ``path`` and its target."""
        parent, name = os.path.split(os.path.join(folder, path))
        real_path = os.path.join(os.path.realpath(parent), name)
        if name in (b"", b".", b".."):
            real_path = os.path.realpath(real_path)
        target = os.path.realpath(real_path) if os.path.islink(real_path) else real_path
        return self._has(real_path, folder) and self._has(target, folder)

    def _has(self, path: bytes, folder: bytes) -> bool:
        parents = _list_parent_folders(path)
        if path in self._exactly or path in self._beneath or not self._beneath.isdisjoint(parents):
            return True
        return folder != b"/" and folder in (path, *parents)


def _list_parent_folders(path: bytes) -> list[bytes]:
    folders = []
    while path != (path := os.path.dirname(path)):
        folders.append(path)
    return folders


def _serve_requests(door: socket.socket, known_paths: _KnownPaths) -> None:
    """Answer requests until the zygote and its children have ended."""
    lockdown.forbid_new_privileges()
    with contextlib.suppress(lockdown.LayerMissing):
        # Not a version that restricts signals: the signal of its death must reach the zygote.
        lockdown.restrict_files((), 5)
    guests: dict[int, _RegisteredChild] = {}
    poll = select.epoll()
    poll.register(door.fileno(), select.EPOLLIN)
    while True:
        for fd, event in poll.poll():
            if fd == door.fileno():
                guest = _accept_child(door)
                guests[guest.requests] = guest
                poll.register(guest.requests, select.EPOLLIN)
            elif event & select.EPOLLIN:
                with contextlib.suppress(OSError):  # the child may have ended
                    _answer_request(guests[fd], known_paths)
            else:
                closed_guest = guests.pop(fd)
                os.close(closed_guest.requests)
                os.close(closed_guest.memory)


def _accept_child(door: socket.socket) -> _RegisteredChild:
    folder, ancillary, _, _ = door.recvmsg(_MAX_PATH_LENGTH, socket.CMSG_SPACE(2 * 4))
    if not folder:
        os.wait()
        os._exit(0)
    descriptors = array.array("i")
    for _, _, payload in ancillary:
        descriptors.frombytes(payload)
    questions, memory = descriptors
    return _RegisteredChild(questions, memory, folder)


def _answer_request(guest: _RegisteredChild, known_paths: _KnownPaths) -> None:
    """Answer one request. The child waits and has no other thread that could change the path meanwhile."""
    question = bytearray(_QUESTION.size)
    fcntl.ioctl(guest.requests, _RECEIVE, question)
    identity, _, _, number, _, _, *arguments = _QUESTION.unpack(question)
    try:
        error = _check_request(guest, known_paths, number, arguments)
    except (OSError, OverflowError, ValueError):
        error = errno.EACCES
    answer = _ANSWER.pack(identity, 0, -error, 0 if error else _CONTINUE)
    fcntl.ioctl(guest.requests, _SEND, answer)


def _check_request(guest: _RegisteredChild, known_paths: _KnownPaths, number: int, arguments: list[int]) -> int:
    """Return an error number, or 0. A forbidden path appears missing, or can't be opened."""
    for folder_argument, path_argument in PATH_ARGUMENTS[number]:
        path, end, _ = os.pread(guest.memory, _MAX_PATH_LENGTH, arguments[path_argument]).partition(b"\0")
        if not end:
            return errno.ENAMETOOLONG
        is_from_folder = folder_argument is None or ctypes.c_int(arguments[folder_argument]).value == _CURRENT_FOLDER
        # A relative path from a descriptor that the child could open is allowed, except with a step up.
        is_from_descriptor = not is_from_folder and not path.startswith(b"/")
        if b".." in path.split(b"/") if is_from_descriptor else not known_paths.has(path, guest.folder):
            return errno.EACCES if number in FLAG_ARGUMENTS else errno.ENOENT
    flags = arguments[FLAG_ARGUMENTS[number]] if number in FLAG_ARGUMENTS else 0
    if flags & os.O_CREAT and not os.path.lexists(os.path.join(guest.folder, path)):
        guest.created_files += 1
    return errno.EDQUOT if guest.created_files > _MAX_FILES else 0
