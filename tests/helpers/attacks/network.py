"""Attacks on the network and on local sockets: each address family separately, because the layers differ."""

from __future__ import annotations

import array
import ctypes
import fcntl
import os
import socket
import struct

from attacks.tools import NEWER, SECCOMP, UNTRIED, attack, call, machine_code, space, targets

LOCAL = "127.0.0.1"
IPPROTO_MPTCP, IPPROTO_SCTP = 262, 132
TYPES = {"stream": 1, "datagram": 2, "raw": 3, "seqpacket": 5}


@attack(NEWER)
def connect_with_tcp():
    socket.create_connection((LOCAL, targets.tcp), 1)
    return True


@attack(NEWER)
def listen_with_tcp():
    with socket.socket() as server:
        server.bind((LOCAL, 0))
        server.listen()
        return True


@attack(SECCOMP)
def listen_without_binding():
    """listen() on an unbound socket opens a port without bind()."""
    with socket.socket() as server:
        server.listen()
        return server.getsockname()[1]


@attack(SECCOMP)
def connect_with_multipath_tcp():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM, IPPROTO_MPTCP) as client:
        client.settimeout(1)
        client.connect((LOCAL, targets.tcp))
        return True


@attack(SECCOMP)
def send_with_udp():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        return client.sendto(b"stolen", (LOCAL, targets.udp))


@attack(SECCOMP)
def send_with_tcp_fast_open():
    with socket.socket() as client:
        client.settimeout(1)
        try:
            return client.sendto(b"stolen", 0x20000000, (LOCAL, targets.tcp))
        except BlockingIOError:
            return True  # the connection is in progress


@attack(SECCOMP)
def connect_to_a_socket_in_a_folder():
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(targets.unix)
        return True


@attack(NEWER)
def connect_to_an_abstract_socket():
    with socket.socket(socket.AF_UNIX) as client:
        client.connect("\0" + targets.abstract)
        return True


@attack(NEWER)
def send_to_an_abstract_socket():
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as client:
        return client.sendto(b"stolen", "\0" + targets.abstract_datagram)


@attack(NEWER)
def send_from_one_of_a_pair():
    left, _ = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    return left.sendto(b"stolen", "\0" + targets.abstract_datagram)


@attack(SECCOMP)
def listen_on_an_abstract_socket():
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(f"\0robomark-decoy-{os.getpid()}")
        server.listen()
        return True


@attack(SECCOMP)
def make_a_pair_of_sockets():
    return socket.socketpair()


@attack(UNTRIED)
def pass_a_descriptor_on_the_wire():
    """A pipe transfers only bytes."""
    with socket.socket(fileno=os.dup(3)) as wire:
        rights = array.array("i", [1]).tobytes()
        return wire.sendmsg([b"\n"], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, rights)])


@attack(UNTRIED)
def ask_who_is_at_the_other_end():
    return call("getsockopt", 3, socket.SOL_SOCKET, socket.SO_PEERCRED, space(12), struct.pack("=i", 12)) == 0


@attack(SECCOMP)
def change_the_buffers_of_the_wire():
    return fcntl.fcntl(3, fcntl.F_SETPIPE_SZ, 4096)


@attack(SECCOMP)
def send_memory_that_can_still_change():
    page = space(16)
    vector = struct.pack("=QQ", ctypes.addressof(page), len(page))
    return call("vmsplice", 3, vector, 0, 0) == 0


@attack(UNTRIED)
def connect_the_wire_to_somebody_else():
    return call("connect", 3, b"\1\0\0" + targets.abstract.encode(), 3 + len(targets.abstract)) == 0


@attack(UNTRIED)
def accept_on_the_wire():
    return call("accept4", 3, 0, 0, 0) >= 0


@attack(UNTRIED)
def look_up_a_name():
    return socket.getaddrinfo("example.com", 80)


@attack(UNTRIED)
def fetch_a_page():
    import urllib.request

    return urllib.request.urlopen("http://example.com", timeout=1).read(1)


@attack(SECCOMP)
def make_a_socket_in_machine_code():
    """mov eax, 41; mov edi, 2; mov esi, 1; xor edx, edx; syscall; ret"""
    fd = machine_code(b"\xb8\x29\0\0\0\xbf\x02\0\0\0\xbe\x01\0\0\0\x31\xd2\x0f\x05\xc3")
    return fd >= 0


def _socket(family, kind, protocol=0):
    return lambda: call("socket", family, TYPES[kind], protocol) >= 0


_FAMILIES = {
    "unix": (1, "stream", 0),
    "internet": (2, "stream", 0),
    "internet_udp": (2, "datagram", 0),
    "internet_udp_lite": (2, "datagram", 136),
    "internet_6": (10, "stream", 0),
    "netlink_route": (16, "raw", 0),
    "netlink_audit": (16, "raw", 9),
    "netlink_uevent": (16, "raw", 15),
    "virtual_machine": (40, "stream", 0),
}
_UNUSUAL = {
    "internet_ping": (2, "datagram", 1),
    "internet_raw": (2, "raw", 1),
    "internet_sctp": (2, "stream", IPPROTO_SCTP),
    "amateur_radio": (3, "datagram", 0),
    "novell": (4, "datagram", 0),
    "appletalk": (5, "datagram", 0),
    "key_management": (15, "raw", 2),
    "packet": (17, "raw", 0x300),
    "reliable_datagrams": (21, "seqpacket", 0),
    "phone_network": (35, "datagram", 0),
    "point_to_point": (24, "datagram", 0),
    "controller_area": (29, "raw", 1),
    "cluster": (30, "stream", 0),
    "bluetooth": (31, "raw", 1),
    "cryptography": (38, "seqpacket", 0),
    "near_field": (39, "raw", 0),
    "multiplexer": (41, "datagram", 0),
    "modem": (42, "datagram", 0),
    "shared_memory": (43, "stream", 0),
    "express_data": (44, "raw", 0),
}
for _name, _arguments in _FAMILIES.items():
    globals()[f"make_a_socket_of_kind_{_name}"] = attack(SECCOMP)(_socket(*_arguments))
for _name, _arguments in _UNUSUAL.items():
    globals()[f"make_a_socket_of_kind_{_name}"] = attack(UNTRIED)(_socket(*_arguments))
