"""SunSpec devices for the tests, built from the models of pysunspec2, and pysunspec2 as a reader of them.

    sunspec.py serve TCPPORT SEED    serves them, says "ready"
    sunspec.py read TCPPORT UNIT     prints each point that pysunspec2 reads: its name and value as JSON

Units 1 to 3 are an inverter, a meter and a battery; those behind them have every other model. Their registers hold random
values, valid ones and markers of what is not implemented. Their marker stands at 40000, 0 and 50000 in turn.
"""

import ipaddress
import json
import os
import random
import socket
import socketserver
import struct
import sys

import sunspec2.mb as mb
import sunspec2.mdef as mdef
import sunspec2.modbus.client as client

FOLDER = os.path.join(os.path.dirname(mdef.__file__), "models", "json")
INVERTER = [1, 103, 160, 120, 121, 122, 123, 701, 702, 703, 704, 705, 712]
METER = [1, 203, 213, 220]
BATTERY = [1, 802, 803, 713, 714, 64999]
SIGNED = {"int16": "h", "int32": "i", "int64": "q"}
UNSIGNED = {"uint16": "H", "enum16": "H", "bitfield16": "H", "acc16": "H", "uint32": "I", "enum32": "I", "bitfield32": "I",
            "acc32": "I", "ipaddr": "I", "uint64": "Q", "bitfield64": "Q", "acc64": "Q"}


def definition(number):
    with open(os.path.join(FOLDER, f"model_{number}.json")) as file:
        return json.load(file)["group"]


def value(point, chance, counts):
    """The bytes of a point: random, or the marker of its type."""
    kind, size = point["type"], point["size"]
    if point["name"] in counts:
        return struct.pack(">H", counts[point["name"]])
    if kind == "pad":
        return b"\0" * 2 * size
    if kind == "string":
        text = "".join(chance.choice("ABCdef 019-") for _ in range(chance.randint(0, 2 * size - 1))).strip()
        return text.encode().ljust(2 * size, b"\0")
    if kind == "sunssf":
        return struct.pack(">h", chance.choice([-32768, *range(-6, 4), *range(-6, 4)]))
    if kind in ("float32", "float64"):
        number = chance.choice([float("nan"), chance.uniform(-1e4, 1e4), chance.uniform(-1, 1), 0.0])
        return struct.pack(">f" if kind == "float32" else ">d", number)
    if kind == "eui48":
        return b"\0\0" + chance.randbytes(6)
    if kind == "ipv6addr":
        return chance.randbytes(16)
    if kind == "count":
        return struct.pack(">H", chance.randint(0, 9))
    form = SIGNED.get(kind) or UNSIGNED[kind]
    bits = 16 * size
    if chance.random() < 0.2:
        marker = {"a": 0, "i": 0 if kind == "ipaddr" else 1 << bits - 1}.get(kind[0], (1 << bits) - 1)
        return marker.to_bytes(2 * size, "big")
    if kind.startswith("enum") and point.get("symbols"):
        return struct.pack(">" + form, chance.choice(point["symbols"])["value"])
    return chance.getrandbits(chance.randint(1, bits)).to_bytes(2 * size, "big")


def contents(group, chance, counts):
    for point in group["points"]:
        yield value(point, chance, counts)
    for part in group.get("groups", []):
        count = part.get("count", 1)
        times = {0: 2}.get(count, count) if isinstance(count, int) else counts[count]
        for _ in range(times):
            yield from contents(part, chance, counts)


def names_of_counts(group):
    for part in group.get("groups", []):
        if isinstance(part.get("count"), str):
            yield part["count"]
        yield from names_of_counts(part)


def model(number, chance):
    """Number, length and registers."""
    if number == 64999:
        return struct.pack(">HHHHH", number, 3, *(chance.getrandbits(16) for _ in range(3)))
    group = definition(number)
    counts = {name: chance.randint(1, 3) for name in names_of_counts(group)}
    body = b"".join(contents({**group, "points": group["points"][2:]}, chance, counts))
    return struct.pack(">HH", number, len(body) // 2) + body


def devices(seed):
    """Base and registers by unit."""
    chance = random.Random(seed)
    every = sorted(int(name[6:-5]) for name in os.listdir(FOLDER) if name.startswith("model_"))
    rest = [number for number in every if number not in {*INVERTER, *METER, *BATTERY}]
    kinds = [INVERTER, METER, BATTERY, *([1, *rest[at:at + 10]] for at in range(0, len(rest), 10))]
    bases = [40000, 0, 50000]
    found = {}
    for unit, numbers in enumerate(kinds, 1):
        registers = b"SunS" + b"".join(model(number, chance) for number in numbers) + b"\xff\xff\0\0"
        found[unit] = (bases[(unit - 1) % 3], registers)
    return found


class Slave(socketserver.BaseRequestHandler):
    def handle(self):
        while head := self.request.recv(8, socket.MSG_WAITALL):
            number, _, length, unit, function = struct.unpack(">HHHBB", head)
            address, count = struct.unpack(">HH", self.request.recv(length - 2, socket.MSG_WAITALL))
            base, registers = self.server.devices.get(unit, (0, b""))
            part = registers[2 * (address - base):2 * (address - base + count)] if base <= address else b""
            if function != 3 or len(part) != 2 * count or 125 < count:
                answer = struct.pack(">BB", function | 0x80, 2)
            else:
                answer = struct.pack(">BB", function, 2 * count) + part
            self.request.sendall(struct.pack(">HHHB", number, 0, len(answer) + 1, unit) + answer)


class Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True


def short(name):
    return {"inverter": "inverter", "ac": "meter"}.get(name.split("_")[0], name) if "_" in name else name


def points(group, path):
    """Each point by the name that it has in a profile, with its definition and its value with its scale factor."""
    for name, point in group.points.items():
        if point.pdef["type"] != "pad" and not (path.count(".") == 0 and name in ("ID", "L")):
            yield f"{path}.{name}", point
    for name, part in group.groups.items():
        for at, one in enumerate(part if isinstance(part, list) else [part], 1):
            yield from points(one, f"{path}.{name}.{at}" if isinstance(part, list) else f"{path}.{name}")


def rows(name, point):
    """Rows of a point: name and what an operator should see, a number, a text or None."""
    kind, seen = point.pdef["type"], point.cvalue
    if seen is None or (point.sf_required and point.sf_value is None):
        # A value without its power of ten is none; pysunspec2 gives it as it came.
        seen = "" if kind == "string" else None
    elif kind == "string":
        seen = " ".join(seen[:250].split())
    elif kind.startswith("enum"):
        seen = {symbol["value"]: symbol["name"] for symbol in point.pdef.get("symbols", [])}.get(seen, seen)
    elif kind == "eui48":
        seen = seen.upper()
    elif kind == "ipaddr":
        seen = str(ipaddress.IPv4Address(seen))
    elif kind == "ipv6addr":
        seen = ipaddress.IPv6Address(int(seen.replace(":", ""), 16)).exploded
    yield {"name": name, "seen": seen}


def read(port, unit):
    device = client.SunSpecModbusClientDeviceTCP(slave_id=unit, ipaddr="127.0.0.1", ipport=port)
    device.scan()
    seen = {}
    for found in device.model_list:
        if found.gdef is None:
            continue
        name = short(found.gname)
        seen[name] = seen.get(name, 0) + 1
        path = name if seen[name] == 1 else f"{name}-{seen[name]}"
        for name, point in points(found, path):
            yield from rows(name, point)
    device.close()


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        with Server(("127.0.0.1", int(sys.argv[2])), Slave) as server:
            server.devices = devices(int(sys.argv[3]))
            print("ready", len(server.devices), flush=True)
            server.serve_forever()
    else:
        for row in read(int(sys.argv[2]), int(sys.argv[3])):
            print(json.dumps(row))
