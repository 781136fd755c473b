#!/usr/bin/env python3
"""Measures the program as a whole and prints one figure a line; asserts nothing.

    cargo build --release && tests/measure.py [--seconds 30]

Needs Linux and Python 3; the plant is the program's own simulator on a pseudo-terminal at 9600 baud.
"""

import argparse
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import tempfile
import termios
import threading
import time

HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PROGRAM = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(HERE, "target")), "release", "sightglass")

PYTHON = os.path.join(os.path.dirname(os.path.dirname(PROGRAM)), "tmp", "peers-venv", "bin", "python")


def say(what, value, goal=""):
    print(f"{what:58} {value:>14}   {goal}", flush=True)


def ticks(pid):
    fields = open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory(pid, name):
    for line in open(f"/proc/{pid}/status"):
        if line.startswith(name + ":"):
            return int(line.split()[1]) / 1024
    return 0.0


def switches(pid):
    total = 0
    for task in os.listdir(f"/proc/{pid}/task"):
        for line in open(f"/proc/{pid}/task/{task}/status"):
            if line.startswith("voluntary_ctxt_switches"):
                total += int(line.split()[1])
    return total


def simulator():
    """The simulated plant alone; gives its process and port."""
    process = subprocess.Popen([PROGRAM, "sim", "tank"], stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().split()[-1]


def stop(process):
    process.send_signal(signal.SIGTERM)
    process.wait(20)


def station(seconds, folder):
    sim, port = simulator()
    run = subprocess.Popen([PROGRAM, "run", "tank", "--port", f"L1={port}", "--history", f"{folder}/m.duckdb"],
                           stdout=subprocess.DEVNULL)
    time.sleep(5)
    cpu, woke = ticks(run.pid), switches(run.pid)
    time.sleep(seconds)
    used, woken = ticks(run.pid) - cpu, switches(run.pid) - woke
    say("run tank: CPU, % of one core", f"{100 * used / seconds:.2f}", "goal < 2")
    say("run tank: memory now (RSS), MB", f"{memory(run.pid, 'VmRSS'):.1f}", "goal < 100")
    say("run tank: memory at most (HWM), MB", f"{memory(run.pid, 'VmHWM'):.1f}")
    say("run tank: wake-ups a second", f"{woken / seconds:.0f}")
    stop(run)
    stop(sim)


class Terminal:
    """A program in a pseudo-terminal of 80 by 24."""

    def __init__(self, args, folder):
        self.start = time.monotonic()
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.environ.update(TERM="xterm-256color", XDG_STATE_HOME=folder)
            os.execv(PROGRAM, [PROGRAM, *args])
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))

    def read(self, seconds, until=None):
        """Bytes that came within a time, or until a text came."""
        end, data = time.monotonic() + seconds, b""
        while (left := end - time.monotonic()) > 0:
            if select.select([self.fd], [], [], left)[0]:
                data += os.read(self.fd, 65536)
                if until and until in data:
                    break
        return data

    def stop(self):
        os.kill(self.pid, signal.SIGTERM)
        try:
            while os.read(self.fd, 65536):
                pass
        except OSError:
            pass
        os.waitpid(self.pid, 0)
        os.close(self.fd)


def first_frame(folder, rounds=7):
    times = []
    for _ in range(rounds):
        terminal = Terminal(["demo"], folder)
        terminal.read(20, until="TK-1".encode())
        times.append(1000 * (time.monotonic() - terminal.start))
        terminal.stop()
    times.sort()
    say("demo: start to first frame, ms (median, most)", f"{times[len(times) // 2]:.0f}, {times[-1]:.0f}", "goal < 400")


def bytes_a_second(seconds, folder):
    terminal = Terminal(["demo"], folder)
    terminal.read(8)
    for key, tab in [("1", "mimic"), ("2", "trends"), ("3", "alarms"), ("4", "controllers"), ("5", "reports")]:
        os.write(terminal.fd, key.encode())
        terminal.read(4)
        say(f"demo running, tab {tab}: bytes a second", f"{len(terminal.read(seconds)) / seconds:.0f}", "goal < 600")
    terminal.stop()
    # Nothing changes: a slave whose registers stand still.
    if not os.path.exists(PYTHON):
        return say("nothing changes: not measured, the tests install pymodbus", "-")
    slave = subprocess.Popen([PYTHON, f"{HERE}/tests/peers/slave.py", "tcp", "15502", "calm"], stdout=subprocess.PIPE, text=True)
    slave.stdout.readline()
    threading.Thread(target=slave.stdout.read, daemon=True).start()
    terminal = Terminal(["tank", "--port", "L1=127.0.0.1:15502", "--history", f"{folder}/n.duckdb"], folder)
    terminal.read(10)
    os.write(terminal.fd, b"A\r")
    for key, tab in [("1", "mimic"), ("3", "alarms"), ("4", "controllers"), ("5", "reports")]:
        os.write(terminal.fd, key.encode())
        terminal.read(4)
        say(f"nothing changes, tab {tab}: bytes a second", f"{len(terminal.read(seconds)) / seconds:.0f}", "goal < 50")
    terminal.stop()
    stop(slave)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as folder:
        station(seconds, folder)
        first_frame(folder)
        bytes_a_second(seconds, folder)


if __name__ == "__main__":
    main()
