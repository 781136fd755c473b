"""Lines with slaves that go wrong as it is stated, for `availability.py`; serial ones keep the pace of a UART."""

import dataclasses
import heapq
import math
import os
import pty
import random
import select
import socket
import struct
import time
import tty

TIMEOUT_S = 1.0
LATE = 1.2 * TIMEOUT_S
REGISTERS = 5  # of a block: a value of four (see `value_of`) and one to write
SPACING = 20  # of blocks
FRAMINGS = {  # mode and baud
    "RTU 19200": ("rtu", 19_200),
    "RTU 115200": ("rtu", 115_200),
    "TCP": ("tcp", 0),
    "RTU over TCP": ("rtu-over-tcp", 0),
}


@dataclasses.dataclass
class Line:
    """What is on one line, how it is polled, and what goes wrong. Times are seconds of the measured time."""
    name: str
    framing: str
    label: str = ""
    units: tuple = (1, 2, 3)
    blocks: tuple = (0, 20, 40, 60)
    period: float = 1.0
    service: float = 0.001  # of the slave, without a UART
    odds: dict = dataclasses.field(default_factory=dict)  # fault: share of the requests
    seed: int = 0
    silent: tuple = ()  # (unit, address or None, from, until)

    def is_silent(self, unit, address, at):
        return any(u == unit and a in (None, address) and start <= at < end for u, a, start, end in self.silent)

    def is_dead(self, unit, address):
        return any(u == unit and a in (None, address) and end == math.inf for u, a, _, end in self.silent)

    def blinks(self, unit):
        return any(u == unit and end < math.inf for u, _, _, end in self.silent)

    def keys(self):
        """(unit, address) of the blocks that can be read at some time."""
        return [(u, a) for u in self.units for a in self.blocks if not self.is_dead(u, a)]

    def response_time(self):
        """Seconds from the first byte of a request to the last one of its answer."""
        baud = FRAMINGS[self.framing][1]
        return (8 + 5 + 2 * REGISTERS) * 11 / baud + silent_interval(baud) if baud else self.service

    def rate(self):
        """Readings a second that slave and wire allow."""
        return 1 / (self.response_time() + silent_interval(FRAMINGS[self.framing][1]))

    def possible(self, seconds):
        """Readings of each block that slave, wire and period allow."""
        return seconds * min(1 / self.period, self.rate() / len(self.keys()))


def silent_interval(baud):
    """3.5 characters before and after a frame on a serial line."""
    return 0.0 if not baud else 1.75e-3 if baud > 19_200 else 3.5 * 11 / baud


def value_of(unit, address, at):
    """44 bits that say whose value it is and when it was read, in hundredths of a second (they repeat after 46 h)."""
    return (unit << 12 | address) << 24 | int(at * 100) & 0xFFFFFF


def is_right(value, unit, address, at):
    """Whether it can be what the slave held at the time of the reading."""
    age = ((int(at * 100) - value) & 0xFFFFFF) / 100
    return value >> 24 == unit << 12 | address and min(age, 0x1000000 / 100 - age) < 0.6 * TIMEOUT_S


def with_crc(frame):
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return frame + struct.pack("<H", crc)


class Slave:
    """The devices of one line, for one master that connects to `where`. `trace` gets a line for each request."""

    def __init__(self, line, trace):
        self.line, self.trace, self.random = line, trace, random.Random(line.seed)
        self.memory, self.free, self.buffers = {}, {}, {}
        self.mode, self.is_serial = FRAMINGS[line.framing][0], FRAMINGS[line.framing][1] > 0
        if self.is_serial:
            self.fd, self.port = pty.openpty()  # the port stays open here too: a master may close it
            tty.setraw(self.fd), tty.setraw(self.port)
            self.where, self.listener = os.ttyname(self.port), None
            self.buffers[self.fd] = b""
        else:
            self.listener = socket.create_server(("127.0.0.1", 0), backlog=8)
            self.where, self.connections = self.listener.getsockname()[1], {}

    def files(self):
        return list(self.buffers) + ([self.listener.fileno()] if self.listener else [])

    def on_ready(self, fd, now, began):
        """Answers with the time at which each is over: (time, fd, frame)."""
        if self.listener and fd == self.listener.fileno():
            connection = self.listener.accept()[0]
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.connections[connection.fileno()] = connection
            self.buffers[connection.fileno()] = b""
            return []
        try:
            data = os.read(fd, 4096)
        except ConnectionResetError:
            data = b""
        if not data:
            del self.buffers[fd], self.connections[fd]
            return []
        self.buffers[fd] += data
        answers = [self.answer(head, message, now, began) for head, message in self.requests(fd)]
        return [(at, fd, frame) for at, frame in filter(None, answers)]

    def requests(self, fd):
        while len(data := self.buffers[fd]) >= 8:
            if self.mode == "tcp":
                size = 6 + int.from_bytes(data[4:6], "big")
                head, message = data[:4], data[6:size]
            else:
                size = 9 + data[6] if data[1] == 16 else 8
                head, message = None, data[:size - 2]
                if len(data) >= size and with_crc(message) != data[:size]:
                    self.buffers[fd] = b""  # noise: until the next request
                    return
            if len(data) < size:
                return
            self.buffers[fd] = data[size:]
            yield head, message

    def answer(self, head, message, now, began):
        unit, function = message[:2]
        address, count = struct.unpack(">HH", message[2:6])
        silent = unit not in self.line.units or self.line.is_silent(unit, address, now - began)
        fault = "silent" if silent else self.fault() if now >= began else ""
        print(self.line.name, unit, address, message[1:].hex(), f"{now:.4f}", fault, file=self.trace)
        if silent:
            return None
        # A device serves its requests in their order; without a UART all devices together serve one at a time.
        takes, gateway = self.line.response_time(), 0.0 if self.is_serial else self.free.get("gateway", 0.0)
        begin = max(now, self.free.get(unit, 0.0), gateway)
        self.free["gateway"] = begin + takes
        if fault == "late":
            begin = max(begin, now + LATE - takes)
        pdu = self.pdu(unit, function, address, count, message, begin)
        if fault == "lost":
            return None
        over = self.free[unit] = begin + takes
        if head is not None:
            if fault == "corrupt" and function == 3:
                pdu = bytes([3, pdu[1] - 2]) + pdu[2:]
            return over, head + struct.pack(">HB", len(pdu) + 1, unit) + pdu
        frame = with_crc(bytes([unit]) + pdu)
        if fault == "corrupt":
            place, bit = self.random.randrange(len(frame)), 1 << self.random.randrange(8)
            frame = frame[:place] + bytes([frame[place] ^ bit]) + frame[place + 1:]
        return over, frame

    def fault(self):
        dice = self.random.random()
        for name, odds in self.line.odds.items():
            if dice < odds:
                return name
            dice -= odds
        return ""

    def pdu(self, unit, function, address, count, message, at):
        if function == 3:
            words = bytearray()
            for register in range(address, address + count):
                block, place = register // SPACING * SPACING, register % SPACING
                held = self.memory.get((unit, register), 0)
                word = value_of(unit, block, at) >> (48 - 16 * place) if place < 4 else held
                words += struct.pack(">H", word & 0xFFFF)
            return bytes([3, 2 * count]) + words
        if function in (6, 16):
            values = [count] if function == 6 else struct.unpack(f">{count}H", message[7:])
            self.memory.update({(unit, register): value for register, value in enumerate(values, address)})
            return message[1:6]
        return message[1:] if function == 8 else bytes([function | 0x80, 1])


def serve(slaves, began):
    """Serves until it is killed. `select` waits to the microsecond, where asyncio and epoll wait in milliseconds."""
    due, number = [], 0
    while True:
        of = {fd: slave for slave in slaves for fd in slave.files()}
        ready = select.select(list(of), [], [], max(0.0, due[0][0] - time.time()) if due else None)[0]
        now = time.time()
        for fd in ready:
            for at, to, frame in of[fd].on_ready(fd, now, began):
                number += 1
                heapq.heappush(due, (at, number, to, frame))
        while due and due[0][0] <= time.time():
            _, _, to, frame = heapq.heappop(due)
            try:
                os.write(to, frame)
            except OSError:
                pass  # the master has gone
