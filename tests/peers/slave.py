"""A pymodbus slave for the tests.

    slave.py rtu PORT | ascii PORT | tcp TCPPORT | rtu-over-tcp TCPPORT | udp UDPPORT | rtu-over-udp UDPPORT   [calm]

Unit 1 looks like a FUJI PXR4, unit 2 like a KOYO DL06; any other register holds its address. In the units 3 to 8 every register
holds its address, and the address says what is wrong with the answer:

    200-299 comes 1.5 s late      300-399 has a wrong check (over TCP: a foreign transaction number)
    400-499 never comes           600-699 breaks off
    700-799 comes as many milliseconds late as the address is above 700
    500-599 has noise before it (over TCP: an answer with a foreign transaction number and another value)

It says "ready" when it serves, then one line for each request that it answers. "calm": nothing moves, nothing is wrong.
"""

import asyncio
import sys

from pymodbus import FramerType, ModbusDeviceIdentification
from pymodbus.server import ModbusSerialServer, ModbusTcpServer, ModbusUdpServer
from pymodbus.simulator import DataType, SimData, SimDevice

KIND, WHERE = sys.argv[1:3]
CALM = sys.argv[3:] == ["calm"]
asked = {"unit": 0, "address": 0}
server = None


def registers(changes):
    values = list(range(20000))
    for address, value in changes.items():
        values[address] = value & 0xFFFF
    return [SimData(0, values=values, datatype=DataType.REGISTERS)]


def bits(on):
    return [SimData(0, values=[address in on for address in range(4096)], datatype=DataType.BITS)]


def pxr():
    # PV -1.5, SV in use 70.0, DV 71.5, MV 12.34 %, no alarms, no input fault; one decimal (41020).
    inputs = {1000: 700 if CALM else -15, 1001: 700, 1002: 0 if CALM else 715, 1003: 1234, 1004: 0, 1006: 0, 1007: 0, 1008: 0, 1009: 0}
    holding = {1001: 0, 1002: 700, 1003: 0, 1004: 0, 1005: 50, 1006: 2400, 1007: 600, 1016: 0, 1017: 0, 1018: 4000,
               1019: 1, 1030: 0, 1031: 4000}
    return SimDevice(1, simdata=(bits(set()), bits(set()), registers(holding), registers(inputs)))


def dl06():
    # Y0 and Y2 on, X4 on, running in auto; step 2 with 125 s left, both as BCD.
    coils, discretes = (set(), set()) if CALM else ({2048, 2050, 3072, 3073}, {2052})
    holding = {1024: 0x0002, 1025: 0x0125, 1026: 0x0007}
    inputs = {1032: 102, 1033: 80, 1034: 40, 1035: 0, 1036: 0, 1037: 0, 1038: 1600}
    return SimDevice(2, simdata=(bits(coils), bits(discretes), registers(holding), registers(inputs)))


def faulty(unit):
    return SimDevice(unit, simdata=(bits(set()), bits(set()), registers({}), registers({})))


def trace_pdu(sending, pdu):
    if not sending:
        asked.update(unit=pdu.dev_id, address=getattr(pdu, "address", 0))
        print(f"asked unit {pdu.dev_id} function {pdu.function_code} address {getattr(pdu, 'address', '-')}", flush=True)
    return pdu


def corrupt(frame):
    """The frame with a check that does not fit."""
    if KIND in ("tcp", "udp"):
        return bytes([frame[0] ^ 0xFF]) + frame[1:]
    if KIND == "ascii":
        return frame[:-3] + (b"1" if frame[-3:-2] == b"0" else b"0") + frame[-2:]
    return frame[:-1] + bytes([frame[-1] ^ 0xFF])


def send(frame):
    """Sends what is late. A library's action that waits would not do: its answer gets unit and transaction of the latest request,
    so that no master could tell it from a right one."""
    for connection in list(server.active_connections.values()):
        connection.send(frame, addr=connection.last_addr if "udp" in KIND else None)


def trace_packet(sending, frame):
    if not sending or not frame or asked["unit"] < 3:
        return frame
    match asked["address"] // 100:
        case 2:
            asyncio.get_running_loop().call_later(1.5, send, frame)
            return b""
        case 3:
            return corrupt(frame)
        case 4:
            return b""
        case 5:
            if KIND in ("tcp", "udp"):
                return corrupt(frame)[:-1] + b"\x55" + frame
            return b"\xff\x00\x55" + frame
        case 6:
            return frame[:-4]
        case 7:
            asyncio.get_running_loop().call_later((asked["address"] - 700) / 1000, send, frame)
            return b""
        case _:
            return frame


async def main():
    global server
    context = [pxr(), dl06()] + [faulty(unit) for unit in range(3, 9)]
    identity = ModbusDeviceIdentification(info_name={"VendorName": "pymodbus", "ProductCode": "SLAVE", "MajorMinorRevision": "V2.10"})
    traces = {"trace_pdu": trace_pdu, "trace_packet": trace_packet, "identity": identity}
    match KIND:
        case "tcp" | "rtu-over-tcp":
            framer = FramerType.SOCKET if KIND == "tcp" else FramerType.RTU
            server = ModbusTcpServer(context, framer=framer, address=("127.0.0.1", int(WHERE)), **traces)
        case "udp" | "rtu-over-udp":
            framer = FramerType.SOCKET if KIND == "udp" else FramerType.RTU
            server = ModbusUdpServer(context, framer=framer, address=("127.0.0.1", int(WHERE)), **traces)
        case "rtu" | "ascii":
            framer = FramerType.RTU if KIND == "rtu" else FramerType.ASCII
            server = ModbusSerialServer(context, framer=framer, port=WHERE, baudrate=9600, bytesize=8, parity="N", stopbits=1,
                                        ignore_missing_devices=True, **traces)
        case _:
            sys.exit(__doc__)
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
