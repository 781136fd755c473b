#!/usr/bin/env python3
"""A station that is ended at any of its disk operations, by a kill or by a loss of power, as a seed says; asserts what must hold.

    cargo build --release && tests/crash.py [BIN_FOLDER] [--seeds 0-99] [--keep FOLDER]

Needs Linux, Python 3 and gcc. crash.c is preloaded into the real program, DuckDB included. A seed says at which operations
of three runs the station ends, whether the last write is torn, which writes, renames and removals that were not synced are
forgotten, between which operations the disk is full, and what an operator does meanwhile. Then it starts once more, and:

    starts      it can be reached within a minute, after every crash
    audit       the log is whole, and has every action that was acknowledged
    history     no file was set aside, unless power was lost and the engine found a damaged block; it has every action of the
                log, and none twice
    samples     stored before a crash are still there, but for the last seconds
    stops       within 30 s of SIGTERM

A failure prints its seed, and `--seeds N-N --keep FOLDER` shows it again.
"""

import argparse
import collections
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

    def start(self, crash_at=0, full=None):
        environment = dict(self.environment)
        if crash_at or full:
            environment |= dict(LD_PRELOAD=str(self.shim), CRASH_FOLDER=str(self.state), CRASH_SHADOW=str(self.shadow), CRASH_AT=str(crash_at))
        if full:
            environment["CRASH_FULL"] = "{}-{}".format(*full)
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


def lose_power(station, dice):
    """Forgets some of what the station did not sync, as the log of its operations tells."""
    synced, renames, removed, created = {}, [], [], set()
    for line in (station.shadow / "log").read_text().splitlines():
        word, *rest = line.split(" ")
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
    dice, acknowledged, stored, power_lost = random.Random(seed), [], [], False
    code, text = station.call("profiles", "tank")
    station.plant.write_text(text + PLANT.format(user=getpass.getuser()))
    for round_number in range(3):
        shutil.rmtree(station.shadow)
        station.shadow.mkdir()
        # Half of them while it opens.
        crash_at = dice.randrange(1, 60 if dice.random() < 0.5 else OPERATIONS)
        full = sorted(dice.sample(range(OPERATIONS), 2)) if dice.random() < 0.3 else None
        station.start(crash_at, full)
        if station.is_reached(60):
            operate(station, random.Random(f"{seed} {round_number}"), f"s{seed}r{round_number}", acknowledged, stored)
        if station.is_alive():
            station.process.kill()
        station.process.wait()
        what = f"ended at {crash_at}, full {full}"
        if dice.random() < 0.5:
            lose_power(station, random.Random(f"{seed} {round_number} lost"))
            what, power_lost = what + ", power lost", True
        station.output.write(f"--- {what}\n".encode())
        station.output.flush()
    station.start()
    if not station.is_reached(60):
        raise Wrong(f"starts: it ended by itself with {station.process.returncode}")
    end = time.monotonic() + 60
    while True:  # it opens the history, completes it from the log and stores once a second
        try:
            check(station, acknowledged, stored, power_lost)
            break
        except Wrong:
            if end < time.monotonic():
                raise
            time.sleep(0.5)
    station.stop()
    code, text = station.call("audit", "verify", station.plant)
    if code != 0:
        raise Wrong(f"audit: {text.strip()[-300:]}")
    return len(acknowledged)


def check(station, acknowledged, stored, power_lost):
    aside = [path.name for path in station.state.rglob("*damaged*")]
    if aside and not (power_lost and "computed checksum" in (station.folder / "out").read_text()):
        raise Wrong(f"history: set aside: {aside}")
    log = station.notes_of_log()
    missing = [note for note in acknowledged if note not in log]
    if missing:
        raise Wrong(f"audit: acknowledged and not in the log: {missing}")
    rows = collections.Counter(row["note"] for row in station.sql("select note from action where note is not null"))
    if rows != log:
        raise Wrong(f"history: actions differ from the log: only there {rows - log}, only in the log {log - rows}")
    for instant, count in stored if not aside else ():
        if stored_before(station, instant) < count:
            raise Wrong(f"samples: {stored_before(station, instant)} before {instant}, there were {count}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binaries", nargs="?", default=HERE.parent / "target/release")
    parser.add_argument("--seeds", default="0-99")
    parser.add_argument("--keep")
    args = parser.parse_args()
    first, last = map(int, args.seeds.split("-"))
    home = pathlib.Path(args.keep or tempfile.mkdtemp(prefix="crash-")).absolute()
    home.mkdir(exist_ok=True)
    shim = home / "crash.so"
    subprocess.run(["gcc", "-O1", "-shared", "-fPIC", "-o", shim, HERE / "crash.c", "-ldl", "-lpthread"], check=True)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    slave = Station(args.binaries, shim, home / "slave", port)
    sim = subprocess.Popen([slave.binaries / "sightglass", "sim", "tank", "--mode", "tcp", "--tcp", f"127.0.0.1:{port}"], env=slave.environment,
                           stdout=subprocess.DEVNULL)
    wrong = 0
    try:
        for seed in range(first, last + 1):
            shutil.rmtree(home / f"seed-{seed}", ignore_errors=True)
            station = Station(args.binaries, shim, home / f"seed-{seed}", port)
            try:
                print(f"seed {seed}: {run(station, seed)} acknowledged", flush=True)
                if not args.keep:
                    shutil.rmtree(station.folder)
            except Wrong as why:
                wrong += 1
                print(f"seed {seed}: {why}; see {station.folder}", flush=True)
            finally:
                if station.process and station.is_alive():
                    station.process.kill()
    finally:
        sim.kill()
    print(f"{last + 1 - first} seeds, {wrong} wrong")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
