#!/usr/bin/env python3
"""A station whose folders hang, as those of a lost server do: each operation waits. Asserts what must hold meanwhile.

    cargo build --release && tests/hang.py [BIN_FOLDER] [--keep FOLDER]

Needs Linux, root, Python 3, gcc and libfuse3-dev, and some minutes. hang.c is a file system of which every operation waits
while a file exists. The folders of the state, of backups, reports, imports and logs hang in the middle of a run and at a
start, and come back:

    polls       values stay good, and are written
    named       `status` and an alarm say what hangs
    jobs        one that hangs can be cancelled, and another is done
    stops       within 30 s of SIGTERM
    returns     what comes back is used again, and what was acknowledged as recorded is in the audit log
"""

import argparse
import datetime
import getpass
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import time

import crash

REPORT = '[[report.automatic]]\nperiod = "shift"\nformats = ["csv"]\n'
FLAGS = ["-D_FILE_OFFSET_BITS=64", "-I/usr/include/fuse3"]


class Station(crash.Station):
    """With folders that hang."""

    def __init__(self, binaries, folder, port, program):
        super().__init__(binaries, None, folder, port)
        self.program, self.gate, self.mounted = program, folder / "hangs", []

    def mount(self, path):
        behind = self.folder / "behind" / path.name
        for each in (behind, path):
            each.mkdir(parents=True, exist_ok=True)
        subprocess.run([self.program, behind, self.gate, path], check=True)
        self.mounted.append(path)
        return path

    def hang(self):
        self.gate.touch()

    def release(self):
        self.gate.unlink(missing_ok=True)

    def start(self, log="-"):
        self.process = subprocess.Popen([self.binaries / "sightglass", "run", self.plant, "--log", log, "--port", f"L1=127.0.0.1:{self.port}"],
                                        env=self.environment, cwd=self.folder, stdout=self.output, stderr=self.output)

    def status(self):
        code, text = self.call("status", timeout=20)
        return text

    def until(self, words, seconds):
        """The status, once it has these words; with `!` in front, once it no longer has them."""
        end = time.monotonic() + seconds
        while True:
            text = self.status()
            if (words.lstrip("!") in text) != words.startswith("!"):
                return text
            if end < time.monotonic():
                raise crash.Wrong(f"named: `{words}` not within {seconds} s:\n" + "\n".join(text.splitlines()[:8]))
            time.sleep(0.5)

    def write(self, note, recorded):
        self.is_read("TIC-1.SV-L")  # the limit of what is written
        code, text = self.call("write", "TIC-1.SV", 50 + len(note), "--note", note, timeout=20)
        if code != 0 or ("not recorded" in text) == recorded:
            raise crash.Wrong(f"polls: a write, code {code}: {text.strip()}")

    def is_read(self, tag):
        end = time.monotonic() + 30
        while not re.search(rf"^tag +{re.escape(tag)} .* good ", self.status(), re.M):
            if end < time.monotonic():
                raise crash.Wrong(f"polls: {tag} is not read within 30 s")
            time.sleep(0.2)

    def polls(self):
        """A value is good and young."""
        text = re.search(r"^tag +TIC-1\.PV .*", self.status(), re.M).group()
        if not re.search(r"good +[0-4]\.\d s", text):
            raise crash.Wrong(f"polls: {text}")

    def cancelled(self, *args):
        job = subprocess.Popen([self.binaries / "sightglass", "history", *map(str, args)], env=self.environment, cwd=self.folder,
                               stdout=self.output, stderr=self.output)
        time.sleep(3)
        if job.poll() is not None:
            raise crash.Wrong(f"jobs: {args[0]} ended although its disk hangs")
        job.send_signal(signal.SIGINT)
        job.wait(10)

    def stopped(self):
        begun = time.monotonic()
        self.stop()
        print(f"  stopped after {time.monotonic() - begun:.1f} s", flush=True)


def state(station):
    """The folder of the state hangs in the middle, comes back, hangs at the stop and at the next start."""
    station.mount(station.state)
    station.start()
    station.is_reached(60)
    station.until("history  good", 20)
    station.write("before", True)
    station.hang()
    station.until("does not respond", 20)
    station.until("station history not recording", 5)
    station.polls()
    station.write("meanwhile", False)
    station.release()
    station.until("history  good", 30)
    station.write("after it", True)
    station.hang()
    station.write("at the end", False)
    station.stopped()
    station.start()
    station.is_reached(60)
    station.until("does not respond", 20)
    station.polls()
    station.release()
    station.until("history  good", 30)
    station.until("RTN        station users file unusable", 10)
    station.write("at last", True)
    log = station.notes_of_log()
    for note in ("before", "meanwhile", "after it", "at last"):
        if note not in log:
            raise crash.Wrong(f"returns: {note} is not in the log")
    rows = station.sql("select note from action where note = 'at last'")
    if len(rows) != 1:
        raise crash.Wrong(f"returns: {rows}")
    station.stopped()
    code, text = station.call("audit", "verify", station.plant)
    if code != 0:
        raise crash.Wrong(f"returns: {text}")


def folders(station):
    """Those of backups, reports, imports and logs hang, then at a start."""
    backups, reports, logs = (station.mount(station.folder / name) for name in ("backups", "reports", "logs"))
    station.mount(station.state / "import")
    soon = datetime.datetime.now(datetime.UTC) + datetime.timedelta(seconds=75)
    begins = iter((soon, soon + datetime.timedelta(minutes=2), soon + datetime.timedelta(hours=10)))
    text = station.plant.read_text().replace('folder = "reports"', f'folder = "{reports}"').replace("[access]", REPORT + "\n[access]", 1)
    text = re.sub(r'start = "\d\d:\d\d"', lambda _: f'start = "{next(begins):%H:%M}"', text.replace("Asia/Bangkok", "UTC"))
    station.plant.write_text(text)
    station.start(logs / "station.log")
    station.is_reached(60)
    station.until("history  good", 20)
    station.hang()
    station.cancelled("backup", station.plant, backups / "one")
    code, said = station.call("history", "backup", station.plant, station.folder / "elsewhere", timeout=60)
    if code != 0:
        raise crash.Wrong(f"jobs: {said}")
    station.until("UNACK      station automatic report fault", 180)
    station.polls()
    station.write("meanwhile", True)
    station.release()
    station.until("RTN        station automatic report fault", 90)
    if not list(reports.glob("*.csv")):
        raise crash.Wrong("returns: there is no report")
    code, said = station.call("history", "backup", station.plant, backups / "two", timeout=60)
    if code != 0:
        raise crash.Wrong(f"returns: {said}")
    station.hang()
    job = subprocess.Popen([station.binaries / "sightglass", "history", "backup", station.plant, backups / "two"], env=station.environment,
                           stdout=station.output, stderr=station.output)
    time.sleep(2)
    station.stopped()
    job.wait(30)
    station.start(logs / "station.log")
    station.is_reached(60)
    station.until("history  good", 20)
    station.is_read("TIC-1.PV")
    station.polls()
    station.release()
    station.write("at last", True)
    station.stopped()
    if "meanwhile" not in station.notes_of_log():
        raise crash.Wrong("returns: an action is missing in the log")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binaries", nargs="?", default=crash.HERE.parent / "target/release")
    parser.add_argument("--keep")
    args = parser.parse_args()
    args.simulated, wrong = None, 0
    home = pathlib.Path(args.keep or tempfile.mkdtemp(prefix="hang-")).absolute()
    home.mkdir(exist_ok=True)
    program = home / "hang"
    subprocess.run(["gcc", "-O1", *FLAGS, "-o", program, crash.HERE / "hang.c", "-lfuse3", "-lpthread"], check=True)
    with crash.simulator(args, None, home) as port:
        for scene in (state, folders):
            shutil.rmtree(home / scene.__name__, ignore_errors=True)
            station = Station(args.binaries, home / scene.__name__, port, program)
            code, text = station.call("profiles", "tank")
            station.plant.write_text(text + crash.PLANT.format(user=getpass.getuser()))
            try:
                print(f"{scene.__name__}: {scene.__doc__}", flush=True)
                scene(station)
            except (crash.Wrong, subprocess.TimeoutExpired) as why:
                wrong += 1
                print(f"{scene.__name__}: {why}; see {station.folder}", flush=True)
            finally:
                station.release()
                if station.process and station.is_alive():
                    station.process.kill()
                    station.process.wait()
                for path in reversed(station.mounted):
                    subprocess.run(["fusermount3", "-u", "-z", path])
    print(f"{wrong} wrong")
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    main()
