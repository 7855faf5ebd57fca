"""Attacks with signals to other processes, with their priorities and limits, and with signals the worker relies on."""

from __future__ import annotations

import fcntl
import os
import resource
import signal
import struct
import threading

from attacks.tools import NEWER, SECCOMP, UNTRIED, attack, call, libc, space, system_calls, targets

PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_SET_SECCOMP, PR_SET_CHILD_SUBREAPER, PR_SET_MM = 1, 4, 22, 36, 35
PR_SET_PTRACER, PR_SET_TIMING, PR_TASK_PERF_EVENTS_DISABLE, PR_SET_KEEPCAPS = 0x59616D61, 14, 31, 8
HIGH = 1 << 32


@attack(NEWER)
def kill_another():
    os.kill(targets.victim, signal.SIGKILL)
    return True


@attack(NEWER)
def signal_the_worker():
    os.kill(targets.worker, 0)
    return True


@attack(NEWER)
def signal_the_zygote():
    os.kill(os.getppid(), 0)
    return True


@attack(NEWER)
def signal_the_zygote_by_thread():
    return call("tkill", os.getppid(), 0) == 0


@attack(NEWER)
def kill_another_thread():
    return call("tgkill", targets.victim, targets.victim, signal.SIGKILL) == 0


@attack(NEWER)
def kill_another_by_thread_number():
    return call("tkill", targets.victim, signal.SIGKILL) == 0


@attack(NEWER)
def kill_another_with_its_handle():
    return call("pidfd_send_signal", call("pidfd_open", targets.victim, 0), signal.SIGKILL, 0, 0) == 0


@attack(NEWER)
def queue_a_signal_to_another():
    information = struct.pack("=iii", signal.SIGKILL, 0, -1) + bytes(116)
    return call("rt_sigqueueinfo", targets.victim, signal.SIGKILL, information) == 0


@attack(NEWER)
def queue_a_signal_to_another_thread():
    information = struct.pack("=iii", signal.SIGKILL, 0, -1) + bytes(116)
    return call("rt_tgsigqueueinfo", targets.victim, targets.victim, signal.SIGKILL, information) == 0


@attack(SECCOMP)
def signal_everybody():
    os.kill(-1, 0)
    return True


@attack(SECCOMP)
def signal_the_own_group():
    os.killpg(0, 0)
    return True


@attack(NEWER)
def signal_another_with_a_high_half():
    """A filter that compares all 64 bits where the kernel reads only 32 decides incorrectly."""
    return call("kill", targets.victim | HIGH, 0) == 0


@attack(SECCOMP)
def send_signals_by_owning_a_pipe():
    reading, _ = os.pipe()
    fcntl.fcntl(reading, fcntl.F_SETOWN, targets.victim)
    return True


@attack(SECCOMP)
def send_signals_by_owning_the_wire():
    fcntl.fcntl(3, fcntl.F_SETOWN, targets.victim)
    return True


@attack(SECCOMP)
def send_signals_by_owning_a_pipe_with_a_high_half():
    return call("fcntl", os.pipe()[0], fcntl.F_SETOWN | HIGH, targets.victim) == 0


@attack(SECCOMP)
def own_a_pipe_by_control():
    """FIOSETOWN has the effect of F_SETOWN, but for sockets."""
    return call("ioctl", 3, 0x8901, struct.pack("=i", targets.victim)) == 0


@attack(SECCOMP)
def own_a_pipe_extended():
    return call("fcntl", os.pipe()[0], 15, struct.pack("=ii", 1, targets.victim)) == 0


@attack(SECCOMP)
def choose_the_signal_of_a_pipe():
    return call("fcntl", os.pipe()[0], 10, signal.SIGKILL) == 0


@attack(SECCOMP)
def outlive_the_zygote():
    return libc.prctl(PR_SET_PDEATHSIG, 0, 0, 0, 0) == 0


@attack(SECCOMP)
def become_readable():
    return libc.prctl(PR_SET_DUMPABLE, 1, 0, 0, 0) == 0


@attack(SECCOMP)
def become_readable_with_a_high_half():
    return call("prctl", PR_SET_DUMPABLE | HIGH, 1, 0, 0, 0) == 0


@attack(SECCOMP)
def adopt_orphans():
    return libc.prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) == 0


@attack(UNTRIED)
def change_the_own_process():
    options = (PR_SET_SECCOMP, PR_SET_MM, PR_SET_PTRACER, PR_SET_TIMING, PR_TASK_PERF_EVENTS_DISABLE, PR_SET_KEEPCAPS)
    return any(libc.prctl(option, 1, 0, 0, 0) == 0 for option in options)


@attack(SECCOMP)
def slow_another_down():
    os.setpriority(os.PRIO_PROCESS, targets.victim, 10)
    return True


@attack(SECCOMP)
def tie_another_to_a_processor():
    os.sched_setaffinity(targets.victim, os.sched_getaffinity(targets.victim))
    return True


@attack(SECCOMP)
def limit_another():
    limits = resource.prlimit(targets.victim, resource.RLIMIT_CORE)
    resource.prlimit(targets.victim, resource.RLIMIT_CORE, limits)
    return True


@attack(SECCOMP)
def change_the_own_limits():
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (hard, hard))
    return True


@attack(SECCOMP)
def change_the_own_limits_the_old_way():
    limits = struct.pack("=QQ", 64, 64)
    return call("setrlimit", resource.RLIMIT_NOFILE, limits) == 0


@attack(UNTRIED)
def raise_the_own_memory():
    resource.setrlimit(resource.RLIMIT_AS, (1 << 40, 1 << 40))
    return True


@attack(SECCOMP)
def schedule_another():
    return call("sched_setscheduler", targets.victim, 3, space(8)) == 0


@attack(UNTRIED)
def schedule_in_real_time():
    return call("sched_setscheduler", 0, 1, struct.pack("=i", 1)) == 0


@attack(UNTRIED)
def leave_the_group():
    os.setpgid(0, 0)
    return True


@attack(UNTRIED)
def leave_the_session():
    os.setsid()
    return True


@attack(UNTRIED)
def time_with_signals():
    """A timer that signals a chosen thread."""
    event = struct.pack("=QiiI", 0, signal.SIGALRM, 0, 0) + bytes(44)
    return call("timer_create", 0, event, space(8)) == 0


@attack(SECCOMP)
def kill_oneself():
    """A child that ends by a SIGKILL which the worker did not send looks as if the machine had killed it."""
    os.kill(os.getpid(), signal.SIGKILL)
    return True


@attack(SECCOMP)
def kill_oneself_with_a_high_half():
    return call("kill", os.getpid() | HIGH, signal.SIGKILL | HIGH) == 0


@attack(SECCOMP)
def kill_the_own_thread():
    return call("tgkill", os.getpid(), os.getpid(), signal.SIGKILL) == 0


@attack(SECCOMP)
def kill_the_own_thread_by_its_number_alone():
    return call("tkill", os.getpid(), signal.SIGKILL) == 0


@attack(SECCOMP)
def raise_the_signal_that_kills():
    return libc["raise"](signal.SIGKILL) == 0


@attack(SECCOMP)
def kill_oneself_as_a_thread():
    signal.pthread_kill(threading.get_ident(), signal.SIGKILL)
    return True


@attack(SECCOMP)
def kill_oneself_with_the_own_handle():
    signal.pidfd_send_signal(os.pidfd_open(os.getpid()), signal.SIGKILL)
    return True


@attack(SECCOMP)
def queue_the_signal_that_kills():
    information = struct.pack("=iii", signal.SIGKILL, 0, -1) + bytes(116)
    return call("rt_sigqueueinfo", os.getpid(), signal.SIGKILL, information) == 0


@attack(SECCOMP)
def have_the_kernel_kill_at_a_limit():
    """The hard limit of processor time is enforced with SIGKILL."""
    signal.signal(signal.SIGXCPU, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CPU, (1, 1))
    while True:
        pass


@attack(SECCOMP)
def have_a_pipe_kill():
    reading, writing = os.pipe()
    fcntl.fcntl(reading, fcntl.F_SETOWN, os.getpid())
    call("fcntl", reading, 10, signal.SIGKILL)
    fcntl.fcntl(reading, fcntl.F_SETFL, os.O_ASYNC)
    os.write(writing, b"x")


@attack(UNTRIED)
def have_a_timer_kill():
    event = struct.pack("=QiiI", 0, signal.SIGKILL, 0, 0) + bytes(44)
    timer = space(8)
    call("timer_create", 1, event, timer)
    call("timer_settime", int.from_bytes(timer.raw[:4], "little"), 0, struct.pack("=qqqq", 0, 0, 0, 1000), None)
    libc.usleep(100_000)


@attack(SECCOMP)
def send_a_signal_that_has_no_name():
    """Send a real-time signal. Such signals are queued and counted for all processes of a user."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {40})
    os.kill(os.getpid(), 40)
    return True


globals().update(
    system_calls(
        SECCOMP,
        getpgid=(0,),
        sched_setparam=(0, space(8)),
        ioprio_set=(1, 0, 2 << 13 | 4),
    )
)
