#!/usr/bin/env python3
"""Stations that are killed while they open their history and while they work on it; asserts what must hold after each round.

    cargo build --release && tests/kills.py [BIN_FOLDER] [--rounds 0-99] [--keep FOLDER]

Needs what crash.py needs. A round is a history of its own: a seed says what is killed and when, in real time. `starts`,
`opening`: a station, `backup`, `import`, `archive`: one that does this job, `compact`, `restore`: the command on a history
at rest. Then the station starts once more, and what crash.py checks must hold: no file was set aside, each action that was
acknowledged is in the audit log and in the history, once.
"""

import argparse
import collections
import getpass
import os
import pathlib
import random
import shutil
import signal
import subprocess
import tempfile
import time

import crash

KILLS = ["starts", "opening", "opening", "opening", "backup", "import", "compact", "restore"]
OF_ROUND = 10
ARCHIVES = 0.02  # of the kills: the archive is looked at after a minute


class Station(crash.Station):
    """One that may be slow: a computer with other work is no fault."""

    def call(self, *args, timeout=120):
        return super().call(*args, timeout=timeout)


def killed(process, after):
    """Kills it after a time; whether it still ran."""
    try:
        process.wait(after)
        return False
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return True


def begun(station, *args):
    return subprocess.Popen([station.binaries / "sightglass", *map(str, args)], env=station.environment, cwd=station.folder,
                            stdout=station.output, stderr=station.output)


def samples(station, number):
    """A file of samples of hours that have none."""
    path = station.folder / f"samples-{number}.csv"
    begin = int(time.time()) - 86_400 * (2 + number)
    rows = (f"TIC-1.PV,{time.strftime('%FT%TZ', time.gmtime(begin + second))},{second % 90}" for second in range(0, 20_000, 2))
    path.write_text("\n".join(["tag,time,value", *rows]) + "\n")
    return path


def operated(station, dice, tag, acknowledged, seconds):
    end, number = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        number += 1
        note = f"{tag}-{number}"
        code, text = station.call("write", "TIC-1.SV", 50 + number % 20, "--note", note)
        if code == 0 and "not recorded" not in text:
            acknowledged.append(note)


def kill(station, dice, what, tag, number, acknowledged):
    """One kill; whether it came in time."""
    if what in ("compact", "restore"):
        backup = station.folder / "backup"
        if what == "restore" and not (backup / "manifest.json").exists():
            station.call("history", "backup", station.plant, backup)
        args = [what, station.plant] + [backup] * (what == "restore")
        return killed(begun(station, "history", *args), dice.uniform(0, 0.6))
    station.start()
    if what == "opening":
        return killed(station.process, dice.uniform(0, 0.15))
    if not station.is_reached(60):
        raise crash.Wrong(f"starts: it ended by itself with {station.process.returncode}")
    operated(station, dice, tag, acknowledged, dice.uniform(0, 1))
    if what == "archive":
        return killed(station.process, dice.uniform(61, 64))
    if what in ("backup", "import"):
        target = station.folder / "backups" if what == "backup" else samples(station, number)
        job = begun(station, "history", what, station.plant, target)
        time.sleep(dice.uniform(0, 1.2))
        done = killed(station.process, 0)
        job.wait(60)
        return done
    return killed(station.process, dice.uniform(0, 0.5))


def run(station, seed, kills):
    dice, acknowledged = random.Random(seed), []
    code, text = station.call("profiles", "tank")
    station.plant.write_text(text + crash.PLANT.format(user=getpass.getuser()))
    station.start()
    if not station.is_reached(60):
        raise crash.Wrong("starts: not at all")
    operated(station, dice, f"s{seed}", acknowledged, 2)
    killed(station.process, 0)
    for number in range(OF_ROUND):
        what = "archive" if dice.random() < ARCHIVES else dice.choice(KILLS)
        kills[what, kill(station, dice, what, f"s{seed}k{number}", number, acknowledged)] += 1
        station.output.write(f"--- killed: {what}\n".encode())
        station.output.flush()
    station.start()
    if not station.is_reached(60):
        raise crash.Wrong(f"starts: it ended by itself with {station.process.returncode}")
    end = time.monotonic() + 60
    while True:
        try:
            crash.check(station, acknowledged, [])
            break
        except crash.Wrong:
            if end < time.monotonic():
                raise
            time.sleep(0.5)
    station.stop()
    code, text = station.call("audit", "verify", station.plant)
    if code != 0:
        raise crash.Wrong(f"audit: {text.strip()[-300:]}")
    return f"{len(acknowledged)} actions acknowledged"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binaries", nargs="?", default=crash.HERE.parent / "target/release")
    parser.add_argument("--rounds", default="0-99")
    parser.add_argument("--keep")
    args = parser.parse_args()
    args.simulated = None
    first, last = map(int, args.rounds.split("-"))
    home = pathlib.Path(args.keep or tempfile.mkdtemp(prefix="kills-")).absolute()
    home.mkdir(exist_ok=True)
    kills, wrong = collections.Counter(), 0
    with crash.simulator(args, None, home) as port:
        for seed in range(first, last + 1):
            shutil.rmtree(home / f"round-{seed}", ignore_errors=True)
            station = Station(args.binaries, None, home / f"round-{seed}", port)
            try:
                print(f"round {seed}: {run(station, seed, kills)}", flush=True)
                shutil.rmtree(station.folder)
            except (crash.Wrong, subprocess.TimeoutExpired) as why:
                wrong += 1
                print(f"round {seed}: {why}; see {station.folder}", flush=True)
            finally:
                station.output.close()
                if station.process and station.is_alive():
                    station.process.kill()
            print(f"  {sum(kills.values())} kills so far, in time: {({what: count for (what, timely), count in kills.items() if timely})}", flush=True)
    print(f"{last + 1 - first} rounds, {sum(kills.values())} kills, {wrong} wrong")
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    main()
