#!/usr/bin/env python3
"""A station that is ended at any of its disk operations, by a kill or by a loss of power, as a seed says; asserts what must hold.

    cargo build --release && tests/crash.py [BIN_FOLDER] [--seeds 0-99] [--keep FOLDER] [--simulated PROGRAM]

Needs Linux, Python 3 and gcc. crash.c is preloaded into the real program, DuckDB included. A seed says at which operations
of three runs the station ends, whether the last write is torn, which writes, renames and removals that were not synced are
forgotten, between which operations the disk is full, and what an operator does meanwhile. Then it starts once more, and:

    starts      it can be reached within a minute, after every crash
    audit       the log is whole, and has every action that was acknowledged
    history     no file was set aside; it has every action of the log, and none twice
    samples     stored before a crash are still there, but for the last seconds
    stops       within 30 s of SIGTERM

A failure prints its seed, and `--seeds N-N --keep FOLDER` shows it again. With `--simulated`, each run is a life in virtual
time, see tests/simulation: it operates and looks by itself, and says what is wrong.
"""

import argparse
import collections
import concurrent.futures
import contextlib
import datetime
import getpass
import json
import os
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).parent
LAST_S = 3  # so much of the samples may be lost
OPERATIONS = 1_500  # of a run of a few seconds
SIMULATED_OPERATIONS = 600  # of a minute
BLOCK = 4096  # written whole or not at all, as disks do
PLANT = """
[access]
anonymous_view = true
trusted = [{{ user = "{user}", role = "supervisor" }}]
"""


class Wrong(Exception):
    """What does not hold."""


class Station:
    def __init__(self, binaries, shim, folder, port):
        self.binaries, self.shim, self.folder, self.port = pathlib.Path(binaries), shim, folder, port
        self.state, self.shadow = folder / "state/sightglass", folder / "shadow"
        for path in (self.state, self.shadow, folder / "run/sightglass", folder / "config"):
            path.mkdir(parents=True, mode=0o700, exist_ok=True)
        self.environment = dict(os.environ, HOME=str(folder), XDG_STATE_HOME=str(folder / "state"), XDG_CONFIG_HOME=str(folder / "config"),
                                XDG_RUNTIME_DIR=str(folder / "run"), LD_LIBRARY_PATH=str(self.binaries))
        self.plant, self.process = folder / "tank.toml", None
        self.output = open(folder / "out", "ab")

    def call(self, *args, timeout=30):
        done = subprocess.run([self.binaries / "sightglass", *map(str, args)], env=self.environment, text=True, cwd=self.folder,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=timeout)
        return done.returncode, done.stdout if done.returncode == 0 else done.stdout + done.stderr

    def disk(self, end):
        """The environment of a run that ends so; of one that ends by itself, nothing."""
        if not end:
            return {}
        environment = dict(LD_PRELOAD=str(self.shim), CRASH_FOLDER=str(self.state), CRASH_SHADOW=str(self.shadow), CRASH_AT=str(end.at))
        if end.full:
            environment["CRASH_FULL"] = "{}-{}".format(*end.full)
        if end.loses_power:
            environment["CRASH_TORN"] = "1"
        return environment

    def start(self, end=None):
        environment = self.environment | self.disk(end)
        self.process = subprocess.Popen([self.binaries / "sightglass", "run", self.plant, "--log", "-", "--port", f"L1=127.0.0.1:{self.port}"], env=environment,
                                        cwd=self.folder, stdout=self.output, stderr=self.output)

    def is_alive(self):
        return self.process.poll() is None

    def is_reached(self, seconds):
        """Until it can be reached; False if it ended before."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if not self.is_alive():
                return False
            if self.call("status")[0] in (0, 1):
                return True
            time.sleep(0.05)
        raise Wrong(f"starts: not reached within {seconds} s")

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise Wrong("stops: not within 30 s of SIGTERM") from None

    def sql(self, query):
        code, text = self.call("sql", self.plant, query, "--json")
        if code != 0:
            raise Wrong(f"history: {query}: {text.strip()[:300]}")
        return json.loads(text)

    def notes_of_log(self):
        entries = map(json.loads, (self.state / "tank.audit.jsonl").read_text().splitlines())
        # A request that the end came before has no result.
        return collections.Counter(entry["note"] for entry in entries if entry.get("note") and not entry["action"].endswith(" requested"))


End = collections.namedtuple("End", "at full loses_power")


def an_end(dice, operations):
    """How a run ends; half of them end while it opens."""
    at = dice.randrange(1, 60 if dice.random() < 0.5 else operations)
    return End(at, sorted(dice.sample(range(operations), 2)) if dice.random() < 0.3 else None, dice.random() < 0.5)


def after(station, end, dice):
    """What the end of a run leaves behind."""
    if end.loses_power:
        lose_power(station, dice)
    station.output.write(f"--- {end}\n".encode())
    station.output.flush()


def lose_power(station, dice):
    """Forgets some of what the station did not sync, as the log of its operations tells."""
    synced, renames, removed, created = {}, [], [], set()
    for line in (station.shadow / "log").read_text().splitlines():
        word, *rest = line.split("\t")
        if word == "sync":
            synced[rest[0]] = rest[1]
            created.discard(rest[0])  # file systems keep the name of a new file with its content
        elif word == "create":
            created.add(rest[0])
        elif word == "rename":
            renames.append(rest)
            synced[rest[1]] = synced.pop(rest[0], "-")
            created.discard(rest[0])
        elif word == "remove":
            removed.append(rest)
            synced.pop(rest[0], None)
            created.discard(rest[0])
        elif word == "folder":
            inside = lambda path: os.path.dirname(path) == rest[0]
            renames = [rename for rename in renames if not inside(rename[1])]
            removed = [remove for remove in removed if not inside(remove[0])]
            created = {path for path in created if not inside(path)}
    for path, kept in synced.items():
        if kept == "-" or not os.path.exists(path) or dice.random() < 0.5:
            continue
        now, before = pathlib.Path(path).read_bytes(), (station.shadow / kept).read_bytes()
        # Of what was written since, some blocks have reached the disk; the length may be either.
        mixed = bytearray(dice.choice([now, before]))
        for at in range(0, min(len(mixed), len(now)), BLOCK):
            block = dice.choice([now, before])[at:at + BLOCK]
            mixed[at:at + BLOCK] = block.ljust(min(BLOCK, len(mixed) - at), b"\0")[:len(mixed) - at]
        pathlib.Path(path).write_bytes(mixed)
    # A name that was not synced may be as before: the last of them only, so that each path has one past.
    for old, new, kept in renames[-1:]:
        if dice.random() < 0.5 and os.path.exists(new) and not os.path.exists(old):
            os.rename(new, old)
            if kept != "-":
                shutil.copy(station.shadow / kept, new)
    for path, kept in removed[-1:]:
        if dice.random() < 0.5 and kept != "-" and not os.path.exists(path):
            # Its folder may have been removed after it.
            os.makedirs(os.path.dirname(path), exist_ok=True)
            shutil.copy(station.shadow / kept, path)
    for path in created:
        if dice.random() < 0.2 and os.path.exists(path):
            os.remove(path)


def stored_before(station, instant):
    return station.sql(f"select count(*) as count from sample where utc < '{instant}'")[0]["count"]


def operate(station, dice, tag, acknowledged, stored):
    """What an operator does until the station ends, for a few seconds."""
    end, number = time.monotonic() + dice.uniform(1, 4), 0
    while station.is_alive() and time.monotonic() < end:
        number += 1
        what = dice.random()
        if what < 0.75:
            note = f"{tag}-{number}"
            code, text = station.call("write", "TIC-1.SV", 50 + number % 20, "--note", note)
            if code == 0 and "not recorded" not in text:
                acknowledged.append(note)
        elif what < 0.85:
            station.call("ack", "--all")
        elif what < 0.95:
            instant = (datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=LAST_S)).strftime("%F %T")
            try:
                stored.append((instant, stored_before(station, instant)))
            except Wrong:
                pass  # it has ended, or the disk is full
        else:
            station.call("history", "backup", station.plant, station.folder / f"backup-{tag}-{number}.duckdb")


def run(station, seed):
    dice, acknowledged, stored = random.Random(seed), [], []
    code, text = station.call("profiles", "tank")
    station.plant.write_text(text + PLANT.format(user=getpass.getuser()))
    for round_number in range(3):
        shutil.rmtree(station.shadow)
        station.shadow.mkdir()
        end = an_end(dice, OPERATIONS)
        station.start(end)
        if station.is_reached(60):
            operate(station, random.Random(f"{seed} {round_number}"), f"s{seed}r{round_number}", acknowledged, stored)
        if station.is_alive():
            station.process.kill()
        station.process.wait()
        after(station, end, random.Random(f"{seed} {round_number} lost"))
    station.start()
    if not station.is_reached(60):
        raise Wrong(f"starts: it ended by itself with {station.process.returncode}")
    end = time.monotonic() + 60
    while True:  # it opens the history, completes it from the log and stores once a second
        try:
            check(station, acknowledged, stored)
            break
        except Wrong:
            if end < time.monotonic():
                raise
            time.sleep(0.5)
    station.stop()
    code, text = station.call("audit", "verify", station.plant)
    if code != 0:
        raise Wrong(f"audit: {text.strip()[-300:]}")
    return f"{len(acknowledged)} actions"


def check(station, acknowledged, stored):
    aside = [path.name for path in station.state.rglob("*damaged*")]
    if aside:
        raise Wrong(f"history: set aside: {aside}")
    log = station.notes_of_log()
    missing = [note for note in acknowledged if note not in log]
    if missing:
        raise Wrong(f"audit: acknowledged and not in the log: {missing}")
    rows = collections.Counter(row["note"] for row in station.sql("select note from action where note is not null"))
    if rows != log:
        raise Wrong(f"history: actions differ from the log: only there {rows - log}, only in the log {log - rows}")
    for instant, count in stored:
        if stored_before(station, instant) < count:
            raise Wrong(f"samples: {stored_before(station, instant)} before {instant}, there were {count}")


class SimulatedStation(Station):
    """A station whose lives are processes of PROGRAM."""

    program = None

    def live(self, seed, number, base, end=None):
        environment = dict(self.environment, SIGHTGLASS_LIFE=str(seed), SIGHTGLASS_LIFE_NUMBER=str(number), SIGHTGLASS_BASE=str(base),
                           SIGHTGLASS_LAST=str(int(not end)), SIGHTGLASS_FOLDER=str(self.folder), RUST_BACKTRACE="1", **self.disk(end))
        with open(self.folder / "facts", "ab") as facts:
            self.process = subprocess.Popen([self.program], env=environment, cwd=self.folder, stdout=facts, stderr=self.output)
        try:
            code = self.process.wait(120)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise Wrong(f"life {number}: it hangs") from None
        said = (self.folder / "facts").read_text().splitlines()
        wrong = [line for line in said if line.startswith("wrong ")]
        if wrong:
            raise Wrong(f"life {number}: {wrong[0][6:606]}" + f" and {len(wrong) - 1} more" * (len(wrong) > 1))
        if code not in (0, -signal.SIGKILL) or not end and said[-1].strip() != "ended":
            raise Wrong(f"life {number}: it ended by itself with {code}")


def simulate(station, seed):
    dice, base = random.Random(seed), 1_772_000_000 + random.Random(seed).randrange(3600)
    code, text = station.call("profiles", "tank")
    mode = dice.choice(['mode = "rtu"', 'mode = "rtu"', 'mode = "ascii"'])
    station.plant.write_text(text.replace('mode = "rtu"', mode) + PLANT.format(user=getpass.getuser()))
    for number in range(3):
        shutil.rmtree(station.shadow)
        station.shadow.mkdir()
        end = an_end(dice, SIMULATED_OPERATIONS)
        station.live(seed, number, base, end)
        after(station, end, random.Random(f"{seed} {number} lost"))
        base += 100 + dice.choice([0, 60, 1800, 7200])
    station.live(seed, 3, base)
    aside = [path.name for path in station.state.rglob("*damaged*")]
    if aside:
        raise Wrong(f"history: set aside: {aside}")
    said = (station.folder / "facts").read_text().splitlines()
    compared = sum(int(line.split()[1]) for line in said if line.startswith("compared "))
    return f"{compared} good values right, {sum(line.startswith('recorded ') for line in said)} actions"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binaries", nargs="?", default=HERE.parent / "target/release")
    parser.add_argument("--seeds", default="0-99")
    parser.add_argument("--keep")
    parser.add_argument("--simulated")
    args = parser.parse_args()
    first, last = map(int, args.seeds.split("-"))
    home = pathlib.Path(args.keep or tempfile.mkdtemp(prefix="crash-")).absolute()
    home.mkdir(exist_ok=True)
    shim = home / "crash.so"
    subprocess.run(["gcc", "-O1", "-shared", "-fPIC", "-o", shim, HERE / "crash.c", "-ldl", "-lpthread"], check=True)
    SimulatedStation.program = args.simulated
    with simulator(args, shim, home) as port:

        def tried(seed):
            shutil.rmtree(home / f"seed-{seed}", ignore_errors=True)
            station = (SimulatedStation if args.simulated else Station)(args.binaries, shim, home / f"seed-{seed}", port)
            try:
                print(f"seed {seed}: {(simulate if args.simulated else run)(station, seed)} acknowledged", flush=True)
                if not args.keep:
                    shutil.rmtree(station.folder)
                return 0
            except Wrong as why:
                print(f"seed {seed}: {why}; see {station.folder}", flush=True)
                return 1
            finally:
                station.output.close()
                if station.process and station.is_alive():
                    station.process.kill()

        # Those in real time need their time.
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count() if args.simulated else 1) as pool:
            wrong = sum(pool.map(tried, range(first, last + 1)))
    print(f"{last + 1 - first} seeds, {wrong} wrong")
    sys.exit(wrong > 0)


@contextlib.contextmanager
def simulator(args, shim, home):
    """The port of a simulated plant, for stations in real time."""
    if args.simulated:
        yield 0
        return
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    slave = Station(args.binaries, shim, home / "slave", port)
    sim = subprocess.Popen([slave.binaries / "sightglass", "sim", "tank", "--mode", "tcp", "--tcp", f"127.0.0.1:{port}"], env=slave.environment,
                           stdout=subprocess.DEVNULL)
    try:
        yield port
    finally:
        sim.kill()


if __name__ == "__main__":
    main()
