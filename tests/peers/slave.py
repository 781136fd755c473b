"""A pymodbus slave for the tests: unit 1 looks like a FUJI PXR4, unit 2 like a KOYO DL06; any other register holds its address.

    slave.py rtu PORT | slave.py tcp TCPPORT [calm]        says "ready" when it serves, then one line for each request that it answers
"""

import asyncio
import sys

from pymodbus import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


def registers(changes):
    values = list(range(20000))
    for address, value in changes.items():
        values[address] = value & 0xFFFF
    return [SimData(0, values=values, datatype=DataType.REGISTERS)]


def bits(on):
    return [SimData(0, values=[address in on for address in range(4096)], datatype=DataType.BITS)]


CALM = sys.argv[3:] == ["calm"]  # nothing moves, nothing is wrong


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


def trace_pdu(sending, pdu):
    if not sending:
        print(f"asked unit {pdu.dev_id} function {pdu.function_code} address {getattr(pdu, 'address', '-')}", flush=True)
    return pdu


async def main():
    kind, where = sys.argv[1:3]
    context = [pxr(), dl06()]
    if kind == "tcp":
        server = ModbusTcpServer(context, address=("127.0.0.1", int(where)), trace_pdu=trace_pdu)
    else:
        server = ModbusSerialServer(context, framer=FramerType.RTU, port=where, baudrate=9600, bytesize=8, parity="N",
                                    stopbits=1, trace_pdu=trace_pdu, ignore_missing_devices=True)
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
