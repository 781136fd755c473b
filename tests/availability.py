#!/usr/bin/env python3
"""The real station beside a plain libmodbus loop, each at slaves of its own with the same faults; asserts nothing.

    cargo build --release && tests/availability.py [BIN_FOLDER [SCENARIO,...]] [--seconds 60] [--keep FOLDER]

Needs Linux, Python 3, gcc and libmodbus-dev. Serial lines are pseudo-terminals whose slave keeps the pace of a UART,
the rest is loopback. Both masters read the same blocks in the same periods with the same timeout at the same time, so
the ratios count, whatever else the machine does. Columns, each "station / libmodbus":

    readings   that the master takes for good, in the measured time; ratio of them
    possible   readings over those that slaves, wire and periods allow
    gap        longest time of any tag without a good reading, s
    back       longest time from the end of a silence to the first good reading, s
    wrong      good readings that are not what the slave held then: each value says its unit, address and time
    CPU, RSS   of the station, with all lines of the scenario
"""

import argparse
import atexit
import collections
import csv
import dataclasses
import getpass
import io
import math
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

from availability_slaves import FRAMINGS, REGISTERS, TIMEOUT_S, Line, Slave, is_right, serve
from measure import HERE, PROGRAM, memory, stop, ticks

WARM_S = 5.0  # both masters know their slaves before faults begin and readings count
WRITES = 450  # in a minute


# Scenarios ---------------------------------------------------------------------------------------------------------

FEW, EIGHT, ALWAYS = (0, 20), tuple(range(1, 9)), (-math.inf, math.inf)


def lines(seeds=(0,), **kinds):
    """A line of each framing and seed."""
    return [Line(f"L{i}s{seed}", framing, f"seed {seed}" if seed else "", seed=seed, **kinds)
            for i, framing in enumerate(FRAMINGS) for seed in seeds]


def faults(**odds):
    return lines(seeds=(1, 2), odds=odds)


def overload():
    """Twice what each line can carry."""
    found = lines(units=EIGHT, service=0.02)
    for line in found:
        line.period = round(len(line.keys()) / (2 * line.rate()), 3)
    return found


def blinking(seconds):
    """Two of four are silent for 3 s of each 20 s, one after the other."""
    return tuple((unit, None, start, start + 3.0) for unit in (2, 3) for start in range(5 * unit - 5, int(seconds), 20))


SCENARIOS = {
    "late": lambda s: faults(late=0.02),
    "lost": lambda s: faults(lost=0.02),
    "corrupt": lambda s: faults(corrupt=0.02),
    "mixed": lambda s: faults(late=0.02, lost=0.02, corrupt=0.02),
    "dead1of3": lambda s: lines(silent=((2, None, *ALWAYS),)),
    "dead1of8": lambda s: lines(units=EIGHT, blocks=FEW, silent=((2, None, *ALWAYS),)),
    "blinking": lambda s: lines(units=(1, 2, 3, 4), blocks=FEW, silent=blinking(s)),
    "beside": lambda s: lines(silent=((1, 40, *ALWAYS), (2, None, s / 2, s / 2 + 3))),
    "all3s": lambda s: lines(units=EIGHT, blocks=FEW, silent=tuple((u, None, s / 2, s / 2 + 3) for u in EIGHT)),
    "writes": lambda s: faults(late=0.02, lost=0.02, corrupt=0.02),
    "overload": lambda s: overload(),
    "64slaves": lambda s: [Line(f"L{i}", "TCP", units=(1,)) for i in range(64)],
}


# The masters -------------------------------------------------------------------------------------------------------

CHILDREN = []


def start(command, **more):
    """A process that does not outlive this one."""
    CHILDREN.append(subprocess.Popen(command, **more))
    return CHILDREN[-1]


@atexit.register
def kill_children():
    for child in CHILDREN:
        if child.poll() is None:
            child.kill()


def start_station(bin_folder, folder, line_tables, devices, profiles):
    """A running station; `profiles` are texts by name."""
    os.makedirs(f"{folder}/devices", exist_ok=True)
    head = ('vendor = "none"\nmodel = "slave"\nrevision = "1"\nstatus = "manual"\nsource = "availability.py"\nnotes = ""\n'
            'address_base = 0\nfunctions = [3, 6, 16]\n')
    for name, text in profiles.items():
        with open(f"{folder}/devices/{name}.toml", "w") as file:
            file.write(head + text)
    with open(f"{folder}/plant.toml", "w") as file:
        file.write(f'title = "availability"\ntime_zone = "UTC"\n[access]\nanonymous_view = true\n'
                   f'trusted = [{{ user = "{getpass.getuser()}", role = "supervisor" }}]\n' + line_tables + devices)
    command = [f"{bin_folder}/sightglass", "run", f"{folder}/plant.toml", "--history", f"{folder}/h.duckdb"]
    command += ["--log", f"{folder}/log"]
    process = start(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if "tags on" not in (first := process.stdout.readline()):
        sys.exit(f"the station did not start: {first}{process.stdout.read()}")
    threading.Thread(target=lambda: open(f"{folder}/out", "w").write(process.stdout.read()), daemon=True).start()
    return process


def line_table(name, framing, where):
    mode, baud = FRAMINGS[framing]
    port = f'port = "{where}"\nbaud = {baud}\nparity = "E"\n' if baud else f'host = "127.0.0.1"\ntcp_port = {where}\n'
    return f'[[line]]\nname = "{name}"\nmode = "{mode}"\ntimeout_ms = {TIMEOUT_S * 1e3:.0f}\n{port}'


def device_table(line, unit, profile, period):
    return (f'[[device]]\nname = "{line}-{unit}"\nprofile = "{profile}"\nline = "{line}"\nunit = {unit}\n'
            f'fast = "{period * 1e3:.0f}ms"\n')


def tag(name, address, kind, more):
    return (f'    {{ name = "{name}", table = "holding", address = {address}, type = "{kind}", poll = "fast", '
            f'confidence = "high", source = "own", {more} }},\n')


def profile(blocks, limits, first, last):
    """Blocks of which the first and the last value are tags: their type, place in the block and other keys."""
    tags = "".join(tag(f"{name}{a}", a + place, kind, more)
                   for a in blocks for name, (kind, place, more) in (("V", first), ("W", last)))
    return f"limits = {{ gap_registers_max = 0, {limits} }}\ntag = [\n{tags}]\n"


def station_of(bin_folder, folder, slaves):
    tables, devices, profiles = "", "", {}
    for line, where in ((slave.line, slave.where) for slave in slaves):
        tables += line_table(line.name, line.framing, where)
        devices += "".join(device_table(line.name, unit, line.name.lower(), line.period) for unit in line.units)
        profiles[line.name.lower()] = profile(line.blocks, f"read_registers_max = {REGISTERS}", ("uint64", 0, 'store = "always"'),
                                              ("uint16", REGISTERS - 1, 'access = "rw", store = "never"'))
    return start_station(bin_folder, folder, tables, devices, profiles)


def libmodbus_of(loop, folder, slave, seconds):
    line = slave.line
    mode, baud = FRAMINGS[line.framing]
    where = ["poll", slave.where, str(baud)] if baud else [f"poll-{mode}", "127.0.0.1", str(slave.where)]
    blocks = [f"{u}:{line.period * 1e6:.0f}:{a}:{REGISTERS}" for u in line.units for a in line.blocks]
    with open(f"{folder}/libmodbus-{line.name}", "w") as out:
        return start([loop, *where, f"{seconds:.1f}", f"{TIMEOUT_S * 1e3:.0f}", *blocks], stdout=out)


def build_loop(folder):
    program = f"{folder}/libmodbus-loop"
    source = f"{HERE}/tests/bench/libmodbus_loop.c"
    subprocess.run(["gcc", "-O2", "-I/usr/include/modbus", source, "-lmodbus", "-o", program], check=True)
    return program


# What they have read -----------------------------------------------------------------------------------------------

def station_readings(bin_folder, folder):
    """Of each line: (time, unit, address, value)."""
    sql = "SELECT epoch_us(utc), tag, CAST(value AS BIGINT) FROM sample WHERE quality = 'good' ORDER BY utc"
    command = [f"{bin_folder}/sightglass", "sql", f"{folder}/plant.toml", sql, "--csv", "--timeout", "10min"]
    command += ["--history", f"{folder}/h.duckdb"]
    text = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    found = collections.defaultdict(list)
    for us, name, value in list(csv.reader(io.StringIO(text)))[1:]:
        line, unit, address = re.fullmatch(r"(.+)-(\d+)\.V(\d+)", name).groups()
        found[line].append((int(us) / 1e6, int(unit), int(address), int(value)))
    return found


def libmodbus_readings(folder, line):
    rows = (row.split() for row in open(f"{folder}/libmodbus-{line.name}"))
    return [(float(at), int(unit), int(address), int(value, 16)) for at, unit, address, value in rows]


@dataclasses.dataclass
class Figures:
    """Of one master at some tags of a line."""
    readings: int = 0
    gap: float = 0.0
    back: float = 0.0
    wrong: int = 0

    @staticmethod
    def of(readings, line, units, began, seconds):
        found, end = Figures(), began + seconds
        times = {key: [began] for key in line.keys() if key[0] in units}
        for at, unit, address, value in readings:
            if unit not in units:
                continue
            found.wrong += not is_right(value, unit, address, at)
            if began <= at < end and (unit, address) in times:
                times[unit, address].append(at)
        for (unit, address), good in times.items():
            found.readings += len(good) - 1
            found.gap = max([found.gap, *(b - a for a, b in zip(good, good[1:] + [end]))])
            for until in (began + to for u, a, _, to in line.silent if u == unit and a in (None, address) and to < seconds):
                found.back = max(found.back, next((at for at in good if at > until), end) - until)
        return found

    def and_also(self, other):
        gap, back = max(self.gap, other.gap), max(self.back, other.back)
        return Figures(self.readings + other.readings, gap, back, self.wrong + other.wrong)


def groups(line):
    """Units whose figures are a row, by a word."""
    blinking = {unit for unit in line.units if line.blinks(unit)}
    if not blinking or blinking == set(line.units):
        return {"": set(line.units)}
    return {"the others": set(line.units) - blinking, "the silent": blinking}


ROW = "{:<10}{:<13}{:<11}{:>7} /{:>7}{:>7}{:>7} /{:>5}{:>8} /{:>5}{:>7} /{:>5}{:>5} /{:>3}{:>7}{:>7}{:>6}"


def print_head():
    print(ROW.format("scenario", "framing", "", "read", "ings", "ratio", "poss", "ible", "gap", "", "back", "", "wro", "ng",
                     "CPU %", "RSS MB", "load"))


def print_rows(scenario, lines, ours, theirs, began, seconds, cpu, rss):
    rows = {}
    for line in lines:
        for word, units in groups(line).items():
            pair = [Figures.of(readings[line.name], line, units, began, seconds) for readings in (ours, theirs)]
            possible = line.possible(seconds) * sum(unit in units for unit, _ in line.keys())
            key = (line.framing, line.label or word)  # lines of one framing are one row
            before, was_possible = rows.get(key, ([Figures(), Figures()], 0))
            rows[key] = ([a.and_also(b) for a, b in zip(before, pair)], was_possible + possible)
    for (framing, word), ((we, they), possible) in rows.items():
        back = (f"{we.back:.1f}", f"{they.back:.1f}") if we.back or they.back else ("-", "-")
        shares = [f"{share:.2f}" for share in (we.readings / max(1, they.readings), we.readings / possible, they.readings / possible)]
        print(ROW.format(scenario, framing, word, we.readings, they.readings, *shares, f"{we.gap:.1f}", f"{they.gap:.1f}", *back,
                         we.wrong, they.wrong, f"{cpu:.1f}", f"{rss:.0f}", f"{os.getloadavg()[0]:.1f}"), flush=True)


# The runs ----------------------------------------------------------------------------------------------------------

def run(scenario, seconds, bin_folder, loop, folder):
    lines = SCENARIOS[scenario](seconds)
    began = time.time() + WARM_S + 1
    traces = [open(f"{folder}/requests-of-{master}", "w", buffering=1) for master in ("station", "libmodbus")]
    sides = [[Slave(line, trace) for line in lines] for trace in traces]
    servers = [multiprocessing.Process(target=serve, args=(slaves, began), daemon=True) for slaves in sides]
    for server in servers:
        server.start()
    loops = [libmodbus_of(loop, folder, slave, began + seconds + 1 - time.time()) for slave in sides[1]]
    station = station_of(bin_folder, folder, sides[0])
    time.sleep(max(0.0, began - time.time()))
    cpu = ticks(station.pid)
    outcomes = Writes(bin_folder, lines, seconds).run() if scenario == "writes" else None
    time.sleep(max(0.0, began + seconds - time.time()))
    cpu, rss = 100 * (ticks(station.pid) - cpu) / (time.time() - began), memory(station.pid, "VmRSS")
    if any(process.wait() for process in loops):
        sys.exit("a libmodbus loop failed")
    stop(station)
    for server in servers:
        server.terminate()
        server.join()
    theirs = {line.name: libmodbus_readings(folder, line) for line in lines}
    print_rows(scenario, lines, station_readings(bin_folder, folder), theirs, began, seconds, cpu, rss)
    if outcomes:
        outcomes.report(folder)


class Writes:
    """Writes at every line at the same time, each value once, spread over the measured time."""

    def __init__(self, bin_folder, lines, seconds):
        self.bin_folder, self.lines, self.seconds, self.outcomes = bin_folder, lines, seconds, []

    def run(self):
        threads = [threading.Thread(target=self.at, args=(line,)) for line in self.lines]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return self

    def at(self, line):
        count, keys = round(self.seconds / 60 * WRITES / len(self.lines)), line.keys()
        start = time.time() + self.seconds / count * self.lines.index(line) / len(self.lines)  # one line after the other
        for number in range(count):
            time.sleep(max(0.0, start + self.seconds * number / count - time.time()))
            unit, address = keys[number % len(keys)]
            command = [f"{self.bin_folder}/sightglass", "write", f"{line.name}-{unit}.W{address}", str(number + 1)]
            done = subprocess.run([*command, "--plant", "plant"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            register = address + REGISTERS - 1
            self.outcomes.append((line.name, unit, register, number + 1, done.returncode, done.stdout.strip()))

    def report(self, folder):
        rows = [row.split() for row in open(f"{folder}/requests-of-station") if not row.endswith("silent\n")]
        # The last two bytes are the value with function 06, and with 16 of one register.
        held = {(*row[:3], int(row[3][-4:], 16)) for row in rows if row[3][:2] in ("06", "10")}
        words, untrue = collections.Counter(), []
        for name, unit, register, value, code, text in self.outcomes:
            outcome = re.sub(r"\d+", "N", text.split(" → ")[-1].partition(": ")[2] or text)
            words[outcome] += 1
            arrived = (name, str(unit), str(register), value) in held
            if code == 0 and not arrived or "refused" in outcome and arrived:
                untrue.append(text)
        backoff = sum(count for outcome, count in words.items() if "backoff" in outcome)
        print(f"    writes: {len(self.outcomes)}, in backoff {backoff}, untrue {len(untrue)} {untrue[:3] or ''}")
        for outcome, count in words.most_common():
            print(f"    {count:5} {outcome}")


def ceiling(seconds, bin_folder, loop, folder):
    """Reads a second and CPU each of one TCP connection with three units of 3,000 blocks; one after the other, three times."""
    window = max(3.0, seconds / 6)

    def station(in_flight):
        server = start([loop, "serve"], stdout=subprocess.PIPE, text=True)
        port, counts = int(server.stdout.readline()), []
        threading.Thread(target=lambda: counts.extend(map(str.split, server.stdout)), daemon=True).start()
        ends = (("uint16", place, 'store = "never"') for place in (0, 9))
        profiles = {"d": profile(range(0, 60_000, 20), f"read_registers_max = 10, in_flight_max = {in_flight}", *ends)}
        devices = "".join(device_table("L", unit, "d", 0.05) for unit in (1, 2, 3))
        process = start_station(bin_folder, folder, line_table("L", "TCP", port), devices, profiles)
        time.sleep(WARM_S)
        cpu, first = ticks(process.pid), len(counts)
        time.sleep(window)
        cpu, last, rss = ticks(process.pid) - cpu, len(counts) - 1, memory(process.pid, "VmRSS")
        stop(process)
        server.wait()
        (t0, n0), (t1, n1) = (map(float, counts[i]) for i in (first, last))
        rate = (n1 - n0) / (t1 - t0)
        return rate, cpu / (rate * window), rss

    def libmodbus():
        server = start([loop, "serve"], stdout=subprocess.PIPE, text=True)
        done = subprocess.check_output([loop, "tcp", "127.0.0.1", server.stdout.readline().strip(), "3"], text=True)
        server.wait()
        reads, took, cpu = map(float, done.split())
        return reads / took, cpu / reads, 0.0

    runs = {"libmodbus": libmodbus, "station, 1 in flight": lambda: station(1), "station, 16 in flight": lambda: station(16)}
    rounds = [{name: run() for name, run in runs.items()} for _ in range(3)]
    results = {name: sorted(results[name] for results in rounds)[1] for name in runs}
    for name, (rate, cpu, rss) in results.items():
        print(f"ceiling   {name:<24}{rate:>9.0f} reads/s {rate / results['libmodbus'][0]:>6.2f} of libmodbus "
              f"{cpu * 1e6:>6.1f} µs CPU each {rss:>6.0f} MB, load {os.getloadavg()[0]:.1f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin_folder", nargs="?", default=os.path.dirname(PROGRAM), help="holds sightglass and libduckdb.so")
    parser.add_argument("scenarios", nargs="?", help=", ".join([*SCENARIOS, "ceiling"]))
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--keep", metavar="FOLDER", help="leave plants, logs and readings here")
    args = parser.parse_args()
    wanted = args.scenarios.split(",") if args.scenarios else [*SCENARIOS, "ceiling"]
    if unknown := [name for name in wanted if name not in SCENARIOS and name != "ceiling"]:
        parser.error(f"no scenario {', '.join(unknown)}")
    bin_folder = os.path.abspath(args.bin_folder)
    with tempfile.TemporaryDirectory() as work:
        # Children are ended by `kill_children`.
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
        for key in ("HOME", "XDG_STATE_HOME", "XDG_RUNTIME_DIR", "XDG_CONFIG_HOME"):
            os.environ[key] = f"{work}/{key.lower()}"
            os.mkdir(os.environ[key], 0o700)
        os.environ["LD_LIBRARY_PATH"] = bin_folder
        loop = build_loop(work)
        print_head()
        for scenario in wanted:
            folder = os.path.join(os.path.abspath(args.keep or work), scenario)
            os.makedirs(folder)
            if scenario == "ceiling":
                ceiling(args.seconds, bin_folder, loop, folder)
            else:
                run(scenario, args.seconds, bin_folder, loop, folder)


main()
