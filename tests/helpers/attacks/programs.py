"""Attacks that start something: programs, processes, threads and foreign code."""

from __future__ import annotations

import _json
import ctypes
import glob
import os
import shutil
import sys

from attacks.tools import EITHER, REMAINS, SECCOMP, UNTRIED, attack, call, libc, machine_code, says_leak, space

CLONE_VM, CLONE_FS, CLONE_FILES, CLONE_SIGHAND, CLONE_THREAD, CLONE_SYSVSEM = (
    0x100,
    0x200,
    0x400,
    0x800,
    0x10000,
    0x40000,
)
SIGCHLD = 17
HIGH = 1 << 32


def _only_here(child):
    """End the new process at once; in the parent, return whether the process was created."""
    if child == 0:
        os._exit(0)
    return child > 0


@attack(SECCOMP)
def fork():
    return _only_here(os.fork())


@attack(SECCOMP)
def fork_by_system_call():
    return _only_here(call("fork"))


@attack(UNTRIED)
def vfork_by_system_call():
    return call("vfork") > 0


@attack(SECCOMP)
def clone():
    return _only_here(call("clone", SIGCHLD, 0, 0, 0, 0))


@attack(SECCOMP)
def clone3():
    arguments = bytes(32) + SIGCHLD.to_bytes(8, "little") + bytes(24)
    return _only_here(call("clone3", arguments, 64))


@attack(SECCOMP)
def clone_with_a_high_half():
    return _only_here(call("clone", SIGCHLD | HIGH, 0, 0, 0, 0))


@attack(UNTRIED)
def clone_a_process_in_the_same_memory():
    return call("clone", CLONE_VM | SIGCHLD, ctypes.addressof(space(65536)) + 65000, 0, 0, 0) > 0


@attack(SECCOMP)
def fork_twice_and_stay():
    if os.fork() == 0:
        _only_here(os.fork())
        os._exit(0)
    return True


@attack(SECCOMP)
def start_a_thread():
    import threading

    thread = threading.Thread(target=int)
    thread.start()
    thread.join()
    return True


@attack(SECCOMP)
def start_a_pool_of_threads():
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        return pool.submit(lambda: 1).result()


@attack(SECCOMP)
def start_a_thread_with_pthreads():
    return libc.pthread_create(space(), None, ctypes.cast(libc.getpid, ctypes.c_void_p), None) == 0


@attack(SECCOMP)
def start_a_process_with_multiprocessing():
    import multiprocessing

    process = multiprocessing.get_context("fork").Process(target=int)
    process.start()
    process.join()
    return True


@attack(EITHER)
def run_a_command():
    return os.system("exit 0") == 0


@attack(EITHER)
def run_a_command_with_subprocess():
    import subprocess

    return subprocess.run(["/bin/true"], check=True)


@attack(EITHER)
def run_a_command_with_popen():
    return os.popen("echo 1").read()


@attack(EITHER)
def spawn_a_program():
    return os.posix_spawn("/bin/true", ["true"], {}) > 0


@attack(EITHER)
def become_a_shell():
    os.execv("/bin/sh", says_leak("true"))


@attack(EITHER)
def become_a_shell_by_system_call():
    arguments = [text.encode() for text in says_leak("true")]
    call("execve", b"/bin/sh", (ctypes.c_char_p * 4)(*arguments, None), None)


@attack(EITHER)
def become_a_shell_through_a_descriptor():
    arguments = [text.encode() for text in says_leak("true")]
    fd = os.open("/bin/sh", os.O_PATH)
    call("execveat", fd, b"", (ctypes.c_char_p * 4)(*arguments, None), None, 0x1000)


@attack(EITHER)
def become_a_program_of_another_user():
    """A set-uid program prints its version on the wire. The version is not a valid frame."""
    os.dup2(3, 1)
    os.execv("/bin/su", ["su", "--version"])


@attack(EITHER)
def become_another_interpreter():
    os.execv(sys.executable, ["python", "-c", "import os; os.write(3, b'no frame\\n')"])


@attack(EITHER)
def become_a_script_in_the_folder():
    with open("script", "w", opener=lambda path, flags: os.open(path, flags, 0o700)) as script:
        script.write("#!/bin/sh\necho no frame >&3\n")
    os.execv("./script", ["script"])


@attack(EITHER)
def become_a_file_in_memory():
    fd = call("memfd_create", b"mine", 0)
    with open("/bin/sh", "rb") as shell:
        os.write(fd, shell.read())
    os.execve(fd, says_leak("true"), {})


@attack(EITHER)
def start_a_program_with_the_loader():
    """The loader is readable and runs programs without execute permission. Starting the loader itself needs it."""
    loader = "/lib64/ld-linux-x86-64.so.2"
    os.execv(loader, [loader, "/bin/sh", *says_leak("true")[1:]])


@attack(SECCOMP)
def make_a_file_in_memory():
    return call("memfd_create", b"mine", 0) >= 0


@attack(EITHER)
def open_a_terminal():
    import pty

    return pty.fork()


@attack(REMAINS)
def run_machine_code():
    """The student's own machine code is confined in the same way as Python."""
    return machine_code(b"\xb8\x2a\x00\x00\x00\xc3") == 42


@attack(REMAINS)
def load_a_library_of_ones_own():
    """A library that the student brings is confined as well."""
    extension = min(glob.glob(os.path.join(os.path.dirname(_json.__file__), "_*.so")))
    shutil.copyfile(extension, "mine.so")
    return ctypes.PyDLL("./mine.so")


@attack(REMAINS)
def switch_off_pythons_refusals():
    """Python's own refusals are only a courtesy. This module disables them to see the kernel's errors."""
    try:
        return os.system("exit 0") is not None
    except OSError as error:
        return "programs here" not in str(error)
