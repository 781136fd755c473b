"""Reads the library of device profiles back with a foreign master, pymodbus, and compares every tag with the station.

    library_master.py SIGHTGLASS PROFILE... [--seed N] [--passes N] [--simulator] [--work FOLDER]

A PROFILE is a file or a folder of device profiles; every_type.toml has what the library does not use. Each is a device of one
plant on one line of Modbus TCP. A pymodbus slave serves contents made from the seed: random words, and among them what a profile
names (numbers that mean nothing, numbers with a name), ends of ranges, dates and texts. With --simulator it is `sightglass sim`
instead, with its values at rest. The station polls the plant, and pymodbus reads the same registers. They are decoded here as
profiles/README.md says, and quality, value, shown text and unit of each tag are compared. Each difference is printed with its row
and registers; the last line has the sums. The program ends with 1 if anything differs. Left out: calculated tags, Enron types.
"""

import argparse
import asyncio
import collections
import contextlib
import datetime
import ipaddress
import json
import math
import pathlib
import random
import re
import shutil
import struct
import subprocess
import sys
import threading
import time
import tomllib
from decimal import Decimal
from fractions import Fraction

from pymodbus.client import ModbusTcpClient
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

TABLES = ("coil", "discrete", "holding", "input")
TEXTS = {"string": 0, "cstring": 0, "chars": 0, "version": 0, "eui48": 4, "ipv4": 2, "ipv6": 8, "epoch32": 2, "clock_words": 6,
         "clock_bytes": 3, "clock_bcd": 3, "time_decimal": 1, "time_bytes": 1, "time_bcd": 1, "time_words": 2}  # registers
SIZES = TEXTS | {"int8": 1, "uint8": 1, "int24": 2, "uint24": 2, "bool": 1}
NOT_FOR_TEXTS = ("scale", "offset", "decimals", "unit", "min", "max", "bad_if")
OCTAL = {"X": ("discrete", 2048), "SP": ("discrete", 3072), "Y": ("coil", 2048), "C": ("coil", 3072), "S": ("coil", 5120),
         "V": ("holding", 0)}  # the Modbus addresses of DirectLOGIC, by the maker's manuals
SPELLED = {"N·m": "Nm", "L/min": "l/min"}
WRITE_ONLY = "w"


# The profile language -----------------------------------------------------------------------------------------------------

def load(path):
    """A profile with exact decimals; hexadecimal numbers stay texts, because in `bad_if` they are patterns of bits."""
    tokens = r'("""[\s\S]*?"""|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|#[^\n]*)|\b0x[0-9A-Fa-f_]+'
    return tomllib.loads(re.sub(tokens, lambda found: found[1] or f'"{found[0]}"', path.read_text()), parse_float=Decimal)


def number(written):
    return int(str(written), 0)


def filled(value, name, place):
    """A row of a repeat block with its name and its place put in."""
    match value:
        case str():
            return value.replace("{n}", name).replace("{i}", str(place))
        case dict():
            return {key: filled(inner, name, place) for key, inner in value.items()}
        case list():
            return [filled(inner, name, place) for inner in value]
    return value


def rows_of(profile):
    """The tags of a profile by name, with defaults, and with what they occupy: `table`, `place`, `kind`, `length`, `size`."""
    rows = [(row, 0) for row in profile.get("tag", [])]
    for block in profile.get("repeat", []):
        names = block.get("names") or [str(place + 1) for place in range(block["count"])]
        fitted = {"when": f"{block['count_from']} > {{i}}"} if "count_from" in block else {}
        rows += [(filled(fitted | row, name, place), place * block.get("step", 0))
                 for place, name in enumerate(names) for row in block["tag"]]
    return {row["name"]: complete(row, moved, profile.get("default", {})) for row, moved in rows}


def complete(row, moved, default):
    table, address = place_of(str(row["address"]), row.get("table", default.get("table", "holding")))
    if table in ("coil", "discrete"):
        default = {"poll": default.get("poll"), "access": default.get("access"), "type": "bool"}
    kind, length = re.fullmatch(r"(\w+?)(?:\((\d+)\))?", row.get("type", default.get("type"))).groups()
    if kind in TEXTS:
        default = {key: value for key, value in default.items() if key not in NOT_FOR_TEXTS and (key, value) != ("order", "CDAB")}
    length = int(length or 0)
    size = SIZES.get(kind) or ((length + 1) // 2 if kind.endswith("string") else length) or int(re.search(r"\d+", kind)[0]) // 16
    return default | row | {"table": table, "place": address + moved, "kind": kind, "length": length, "size": size}


def place_of(address, table):
    """Table and address of `1002`, `0x03EA`, `03EAH`, `holding:1002` and `V2000`."""
    if octal := re.fullmatch(r"([A-Z]+)([0-7]+)", address):
        table, base = OCTAL[octal[1]]
        return table, base + int(octal[2], 8)
    if ":" in address:
        table, address = address.split(":")
    return table, int(address[:-1], 16) if address.endswith("H") else int(address, 0)


# Decoding -----------------------------------------------------------------------------------------------------------------

def in_order(row, words):
    """Words of the device in the order ABCD, and back."""
    order = row.get("order", "ABCD")
    if order in ("BADC", "DCBA"):
        words = [word >> 8 | (word & 0xFF) << 8 for word in words]
    return words[::-1] if order in ("CDAB", "DCBA") else words


def bytes_of(words):
    return b"".join(word.to_bytes(2) for word in words)


def words_of(data):
    return [int.from_bytes(data[place:place + 2]) for place in range(0, len(data), 2)]


def signed(pattern, bits):
    return pattern - (1 << bits) if pattern >> bits - 1 else pattern


def bcd(pattern):
    return int(f"{pattern:x}") if f"{pattern:x}".isdecimal() else None


def raw_of(row, words):
    """What the words hold, a number or a text, or None for what their type cannot be; and the pattern of bits and its width."""
    words = in_order(row, words)
    kind, bits, pattern = row["kind"], 16 * len(words), int.from_bytes(bytes_of(words))
    if kind in TEXTS:
        return text_of(kind, words, row["length"]), pattern, bits
    if kind in ("int8", "uint8"):
        bits, pattern = 8, pattern & 0xFF
    if "field" in row:
        high, _, low = str(row["field"]).partition("-")
        bits = int(high) - int(low or high) + 1
        pattern = pattern >> int(low or high) & (1 << bits) - 1
        return signed(pattern, bits) if kind.startswith("int") and bits > 1 else pattern, pattern, bits
    if kind == "mod10k" or kind == "smod10k":
        parts = [signed(word, 16) if kind == "smod10k" else word for word in words]
        whole = max(map(abs, parts)) < 10000 and (min(parts) >= 0 or max(parts) <= 0)
        raw = sum(part * 10000 ** place for place, part in enumerate(reversed(parts))) if whole else None
    elif kind in ("int24", "uint24"):
        raw = signed(pattern & 0xFFFFFF, 24) if kind == "int24" else pattern & 0xFFFFFF
        raw = raw if pattern >> 24 == 0 or pattern >> 24 == 0xFF and raw < 0 else None
    elif kind.startswith("float"):
        raw = struct.unpack({1: ">e", 2: ">f", 4: ">d"}[len(words)], bytes_of(words))[0]
        raw = raw if math.isfinite(raw) else None
    elif kind.startswith("sm"):
        size = pattern & (1 << bits - 1) - 1
        raw = -size if pattern >> bits - 1 else size
    elif kind.startswith("bcd"):
        raw = bcd(pattern)
    elif kind == "bool":
        raw = int(pattern != 0)
    else:
        raw = signed(pattern, bits) if kind.startswith("int") else pattern
    return raw, pattern, bits


def text_of(kind, words, length):
    data = bytes_of(words)
    parts = [bcd(byte) for byte in data] if kind.endswith("bcd") else list(data)
    try:
        match kind:
            case "string":
                return printed(data[:length].rstrip(b"\0 "))
            case "cstring":
                return printed(data[:length].partition(b"\0")[0].rstrip(b" "))
            case "chars":
                while words and words[-1] in (0, 0x20):
                    words = words[:-1]
                return printed(bytes(min(word, 0xFF) for word in words), " ".join(f"{word:02X}" for word in words))
            case "version":
                return "-".join(".".join(f"{word:04X}") for word in words)
            case "eui48":
                return data[2:].hex(":").upper() if data[2:] not in (bytes(6), b"\xFF" * 6) else None
            case "ipv4" | "ipv6":
                return ipaddress.ip_address(data).exploded if any(data) else None
            case "epoch32":
                return datetime.datetime.fromtimestamp(int.from_bytes(data), datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
            case "clock_words":
                return str(datetime.datetime(*words))
            case "clock_bytes" | "clock_bcd":
                return str(datetime.datetime(2000 + parts[0], *parts[1:]))
            case "time_decimal":
                parts = divmod(words[0], 100)
            case "time_words":
                parts = words
        return f"{datetime.time(*parts):%H:%M}"
    except (ValueError, TypeError):  # no date, no time of day, no decimal digits
        return None


def printed(data, otherwise=None):
    """Text in UTF-8 with a dot for what cannot be printed; of nothing else, its bytes."""
    text = "".join(sign if sign.isprintable() else "·" for sign in data.decode(errors="surrogateescape"))
    return text if text.strip("· ") or not text else otherwise or data.hex(" ").upper()


def means_nothing(row, raw, pattern, bits):
    """Does `bad_if` name this number?"""
    rules = row.get("bad_if", [])
    if rules == "sunspec":
        return pattern == (1 << bits - 1 if row["kind"].startswith("int") else (1 << bits) - 1)
    numbers_only = row["kind"].startswith(("float", "bcd"))
    for rule in rules.get(row["kind"], []) if isinstance(rules, dict) else rules:
        if isinstance(rule, list):
            found = number(rule[0]) <= raw <= number(rule[1])
        elif numbers_only:
            found = number(rule) == (pattern if isinstance(rule, str) else raw)
        else:
            found = number(rule) in (raw, pattern)
        if found:
            return True
    return False


class Device:
    """A unit with a profile, and what pymodbus reads of it."""

    def __init__(self, file, unit):
        self.name, self.unit, self.rows, self.words = file.stem, unit, rows_of(load(file)), {}

    def readable(self):
        return [row for row in self.rows.values() if row.get("access") != WRITE_ONLY]

    def read(self, client):
        reads = {"coil": client.read_coils, "discrete": client.read_discrete_inputs,
                 "holding": client.read_holding_registers, "input": client.read_input_registers}
        for row in self.readable():
            answer = reads[row["table"]](row["place"], count=row["size"], device_id=self.unit)
            bit = row["table"] in ("coil", "discrete")
            self.words[row["name"]] = None if answer.isError() else [int(answer.bits[0])] if bit else answer.registers

    def value(self, name):
        """Quality and value of a tag: a fraction, a text, or None if there is none."""
        row, words = self.rows[name], self.words[name]
        if "when" in row and not self.holds(row["when"]):
            return "not present", None
        if words is None:
            return "bad", None
        raw, pattern, bits = raw_of(row, words)
        if raw is None or row["kind"] not in TEXTS and means_nothing(row, raw, pattern, bits):
            return "bad", None
        quality = "good"
        if "quality_from" in row:
            known, state = self.value(row["quality_from"])
            if known != "good":
                quality = "uncertain"
            elif int(state) & number(row.get("quality_mask", -1)):
                return "bad", None
        if isinstance(raw, str):
            return quality, raw
        value = Fraction(raw) * Fraction(row.get("scale", 1)) + Fraction(row.get("offset", 0))
        for key, powers, sign in (("decimals_from", range(7), -1), ("scale_from", range(-10, 11), 1)):
            if key in row:
                known, power = self.value(row[key])
                if known != "good" or power not in powers:
                    return "bad", None
                value *= Fraction(10) ** (sign * int(power))
        return quality, value

    def holds(self, condition):
        """`when` of the form NAME > NUMBER or NAME >= NUMBER; what is not known holds."""
        name, operator, limit = condition.split()
        quality, value = self.value(name)
        return quality != "good" or value > int(limit) or value == int(limit) and operator == ">="

    def differences(self, row, tag):
        """In what the station differs from the decoding here: what, expected, and what it says."""
        quality, value = self.value(row["name"])
        said = "not present" if tag["cause"] == "not present" else tag["quality"]
        if quality != said:
            return [("quality", quality, said)]
        if value is None or isinstance(value, str):
            return [("text", value, tag["text"])] * (value != tag["text"])
        found = []
        if tag["value"] is None or abs(value - Fraction(tag["value"])) > abs(value) / 10**12 + Fraction(1, 10**300):
            found.append(("value", float(value), tag["value"]))
        raw, pattern, _ = raw_of(row, self.words[row["name"]])
        names = {number(key): name for key, name in row.get("enum", {}).items()}
        name = names.get(raw, names.get(pattern))
        if name is not None:
            found += [("text", name, tag["text"])] * (name != tag["text"])
        elif not shown_as(value, tag["text"], row.get("decimals")):
            found.append(("text", float(value), tag["text"]))
        unit = SPELLED.get(row.get("unit", ""), row.get("unit", ""))
        if "unit_from" in row:
            known, state = self.value(row["unit_from"])
            names = {number(key): name for key, name in self.rows[row["unit_from"]]["enum"].items()}
            unit = names.get(state, "?") if known == "good" else "?"
        return found + [("unit", unit, tag["unit"])] * (unit != (tag["unit"] or ""))


def shown_as(value, text, decimals):
    """Is the text the value, rounded to its last digit, with so many decimals? Floats show 15 digits at most."""
    if not re.fullmatch(r"-?\d+(\.\d+)?(e-?\d+)?", text):
        return False
    digits, _, exponent = text.partition("e")
    last = Fraction(10) ** (int(exponent or 0) - len(digits.partition(".")[2]))
    rounded = abs(Fraction(text) - value) <= last * Fraction(500001, 1000000) + abs(value) / 10**15
    cut = exponent or len(digits.lstrip("-").replace(".", "")) >= 15
    return rounded and (decimals is None or last == Fraction(1, 10**decimals) or bool(cut))


# Contents of the registers ------------------------------------------------------------------------------------------------

def words_for(row, chance, steers):
    """Words for a tag: random ones, or what matters to its type. One that others depend on mostly holds a small number."""
    size, kind, bits = row["size"], row["kind"], 16 * row["size"]
    if row["table"] in ("coil", "discrete"):
        return [chance.getrandbits(1)]
    if chance.random() < (0.1 if steers else 0.3) and not kind.endswith("string"):
        return [chance.getrandbits(16) for _ in range(size)]
    numbers = [chance.randint(0, 6), chance.randint(-10, 10), 0]
    if not steers:
        numbers += [-1, 1 << bits - 1, (1 << bits - 1) - 1, chance.getrandbits(bits // 2), *map(number, row.get("enum", {}))]
        for rule in row["bad_if"] if isinstance(row.get("bad_if"), list) else []:
            numbers += map(number, rule if isinstance(rule, list) else [rule])
    words = words_of((chance.choice(numbers) & (1 << bits) - 1).to_bytes(2 * size))
    date = [chance.randint(*span) for span in ((2000, 2099), (1, 12), (1, 29), (0, 24), (0, 60), (0, 60))]
    since_2000 = [date[0] - 2000, *date[1:]]
    digits = lambda parts: bytes(int(str(part), 16) for part in parts)
    match kind:
        case "float16" | "float32" | "float64":
            value = chance.choice([chance.uniform(-1000, 1000), chance.random() ** 9, 0.0, -0.0, math.nan, -math.inf, 60000.0])
            words = words_of(struct.pack({1: ">e", 2: ">f", 4: ">d"}[size], value)) if chance.random() < 0.8 else words
        case "bcd16" | "bcd32":
            words = words_of(digits(chance.randint(0, 99) for _ in range(2 * size)))
        case "mod10k" | "smod10k":
            sign = chance.choice([1, -1]) if kind == "smod10k" else 1
            words = [sign * chance.choice([0, chance.randint(0, 10000)]) & 0xFFFF for _ in words]
        case "string" | "cstring":
            text = bytes(chance.choices(b"ABC xyz-09~\0\x7F\xC2\xB0\xE9", k=chance.randint(0, 2 * size)))
            words = words_of(text.ljust(2 * size, chance.choice([b"\0", b" "])))
        case "chars":
            words = chance.choices([*b"ABC 09-", 0, 0x4142, 0xB0], k=size)
        case "eui48" | "ipv4" | "ipv6":
            words = [chance.choice([0, 0xFFFF])] * size
        case "clock_words":
            words = date
        case "clock_bytes":
            words = words_of(bytes(since_2000))
        case "clock_bcd":
            words = words_of(digits(since_2000))
        case "time_words":
            words = date[3:5]
        case "time_bytes":
            words = words_of(bytes(date[3:5]))
        case "time_bcd":
            words = words_of(digits(date[3:5]))
        case "time_decimal":
            words = [date[3] * 100 + date[4]]
    return in_order(row, words)


def contents(device, chance):
    """A device for the slave: the words of its tags, and random ones in the gaps between them."""
    keys = ("decimals_from", "scale_from", "quality_from", "unit_from")
    steering = {row.get(key) for row in device.rows.values() for key in keys}
    steering |= {row["when"].split()[0] for row in device.rows.values() if "when" in row}
    held = {table: {} for table in TABLES}
    for row in sorted(device.rows.values(), key=lambda row: row["name"] in steering):
        held[row["table"]].update(enumerate(words_for(row, chance, row["name"] in steering), row["place"]))
    tables = []
    for table, words in held.items():
        bit = table in ("coil", "discrete")
        spans = []
        for address in sorted(words) or [0]:
            if spans and address - spans[-1][-1] < 130:
                spans[-1] += range(spans[-1][-1] + 1, address + 1)
            else:
                spans.append([address])
        tables.append([])
        for span in spans:
            values = [words.get(address, chance.getrandbits(1 if bit else 16)) for address in span]
            tables[-1].append(SimData(span[0], values=list(map(bool, values)) if bit else values,
                                      datatype=DataType.BITS if bit else DataType.REGISTERS))
    return SimDevice(device.unit, simdata=tuple(tables))


@contextlib.contextmanager
def slave(devices, seed):
    """A pymodbus slave with all devices, in a thread; gives its port."""
    chance, started = random.Random(seed), threading.Event()
    context, loop, port = [contents(device, chance) for device in devices], asyncio.new_event_loop(), []

    async def run():
        server = ModbusTcpServer(context, address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        port.append(server.transport.sockets[0].getsockname()[1])
        started.set()

    threading.Thread(target=lambda: (loop.create_task(run()), loop.run_forever()), daemon=True).start()
    started.wait()
    yield port[0]
    loop.call_soon_threadsafe(loop.stop)


@contextlib.contextmanager
def simulator(program, plant):
    """`sightglass sim` with all devices; gives its port."""
    with subprocess.Popen([program, "sim", plant, "--tcp", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield int(process.stdout.readline().rpartition(":")[2])
        finally:
            process.terminate()


# The station --------------------------------------------------------------------------------------------------------------

def at_rest(simulate):
    start = simulate.get("start", simulate.get("oscillate", [None])[0])
    return "{}" if start is None else f"{{ start = {json.dumps(start) if isinstance(start, str) else start} }}"


def plant_file(devices, simulated):
    """A plant with all devices. Also what is read only on request is polled; simulated values may have to rest."""
    lines = ['title = "library"', 'time_zone = "UTC"', "[access]", "anonymous_view = true",
             "[[line]]", 'name = "L1"', 'mode = "tcp"', 'host = "127.0.0.1"']
    for device in devices:
        lines += ["[[device]]", f'name = "{device.name}"', f'profile = "{device.name}"', 'line = "L1"', f"unit = {device.unit}",
                  'fast = "5s"', 'slow = "5s"']
        for row in device.rows.values():
            changes = ['poll = "slow"'] * (row.get("poll") == "never" and row.get("access") != WRITE_ONLY)
            if simulated and "simulate" in row:
                changes.append(f"simulate = {at_rest(row['simulate'])}")
            if changes:
                lines += ["[[device.tag]]", f"name = {json.dumps(row['name'])}", *changes]
    return "\n".join(lines) + "\n"


def station_tags(program, plant, port, wanted):
    """What the station says of each tag, once it has read all that are wanted."""
    options = ["--port", f"L1=127.0.0.1:{port}", "--history", plant.with_suffix(".duckdb"), "--log", plant.with_suffix(".log")]
    with (plant.with_suffix(".out").open("w") as out,
          subprocess.Popen([program, "run", plant, *options], stdout=out, stderr=out) as station):
        try:
            tags = {}
            for _ in range(45):
                time.sleep(2)
                status = subprocess.run([program, "status", plant, *options, "--json"], capture_output=True, text=True)
                if status.returncode == 0:
                    tags = {tag["name"]: tag for tag in json.loads(status.stdout)["tags"]}
                    if all(tags[name]["cause"] != "not read yet" for name in wanted):
                        break
            return tags
        finally:
            station.terminate()


def compare(given, devices, seed, sums):
    folder = given.work / f"seed-{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "devices").mkdir(parents=True)
    for file in given.files:
        shutil.copy(file, folder / "devices")
    plant = folder / "library.toml"
    plant.write_text(plant_file(devices, given.simulator))
    with simulator(given.program, plant) if given.simulator else slave(devices, seed) as port:
        with ModbusTcpClient("127.0.0.1", port=port) as client:
            for device in devices:
                device.read(client)
        wanted = [f"{device.name}.{row['name']}" for device in devices for row in device.readable()]
        tags = station_tags(given.program, plant, port, wanted)
    for device in devices:
        for row in device.readable():
            tag = tags[f"{device.name}.{row['name']}"]
            found = device.differences(row, tag)
            sums.update(["compared", tag["quality"], "differing" if found else "equal", *(kind for kind, _, _ in found)])
            held = " ".join(f"{word:04X}" for word in device.words[row["name"]] or [])
            left_out = ("name", "label", "meaning", "group", "source", "simulate")
            told = ", ".join(f"{key} = {value}" for key, value in row.items() if key not in left_out)
            for kind, expected, said in found:
                print(f"seed {seed}, {tag['name']}: {kind} is {said!r}, expected {expected!r}; registers {held}; "
                      f"{tag['cause'] or tag['text']}; {told}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", metavar="SIGHTGLASS")
    parser.add_argument("profiles", metavar="PROFILE", nargs="+", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--passes", type=int, default=1)
    parser.add_argument("--simulator", action="store_true")
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("library_master"))
    given = parser.parse_args()
    given.files = [file for path in given.profiles for file in (sorted(path.rglob("*.toml")) if path.is_dir() else [path])]
    devices = [Device(file, unit) for unit, file in enumerate(given.files, 1)]
    sums = collections.Counter(profiles=len(devices), tags=sum(len(device.rows) for device in devices))
    for seed in range(given.seed, given.seed + given.passes):
        compare(given, devices, seed, sums)
    print(", ".join(f"{count} {what}" for what, count in sums.items()))
    sys.exit(1 if sums["differing"] else 0)


if __name__ == "__main__":
    main()
