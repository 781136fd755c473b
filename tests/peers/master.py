"""A foreign master for the tests: asks the simulated water tank and prints what it understood, one line for each query.

    master.py pymodbus rtu|ascii PORT | tcp|rtu-over-tcp ADDRESS:TCPPORT
    master.py minimalmodbus rtu|ascii PORT
"""

import sys
import time

PXR, DL06 = 1, 2


class Pymodbus:
    def __init__(self, mode, place):
        from pymodbus import FramerType
        from pymodbus.client import ModbusSerialClient, ModbusTcpClient

        framer = {"rtu": FramerType.RTU, "ascii": FramerType.ASCII, "tcp": FramerType.SOCKET, "rtu-over-tcp": FramerType.RTU}[mode]
        if "tcp" in mode:
            host, port = place.rsplit(":", 1)
            self.client = ModbusTcpClient(host, port=int(port), framer=framer)
        else:
            self.client = ModbusSerialClient(place, framer=framer, baudrate=9600)
        assert self.client.connect()

    def __getattr__(self, name):
        """A call of the library; gives what it asks for, or the exception in words."""
        def call(*arguments, **named):
            answer = getattr(self.client, name)(*arguments, **named)
            return f"exception {answer.exception_code}" if answer.isError() else answer
        return call

    def holding(self, unit, address, count):
        answer = self.read_holding_registers(address, count=count, device_id=unit)
        return getattr(answer, "registers", answer)

    def inputs(self, unit, address, count):
        return self.read_input_registers(address, count=count, device_id=unit).registers

    def coils(self, unit, address, count):
        answer = self.read_coils(address, count=count, device_id=unit)
        return [int(bit) for bit in answer.bits[:count]] if hasattr(answer, "bits") else answer

    def discretes(self, unit, address, count):
        return [int(bit) for bit in self.read_discrete_inputs(address, count=count, device_id=unit).bits[:count]]

    def write_one(self, unit, address, value):
        return self.write_register(address, value, device_id=unit)

    def write_many(self, unit, address, values):
        return self.write_registers(address, values, device_id=unit)

    def write_coil_on(self, unit, address):
        return self.write_coil(address, True, device_id=unit)

    def write_bits(self, unit, address, bits):
        return self.write_coils(address, [bool(bit) for bit in bits], device_id=unit)


class Minimalmodbus:
    def __init__(self, mode, place):
        import minimalmodbus

        self.library = minimalmodbus
        port = minimalmodbus.serial.Serial(place, 9600, timeout=2)
        self.units = {unit: minimalmodbus.Instrument(port, unit, mode=mode) for unit in (PXR, DL06)}

    def call(self, unit, name, *arguments, **named):
        try:
            return getattr(self.units[unit], name)(*arguments, **named)
        except self.library.IllegalRequestError as error:
            words = {"Illegal function": 1, "Illegal data address": 2, "Illegal data value": 3}
            code = next(code for text, code in words.items() if text.lower() in str(error).lower())
            return f"exception {code}"

    def holding(self, unit, address, count):
        return self.call(unit, "read_registers", address, count, functioncode=3)

    def inputs(self, unit, address, count):
        return self.call(unit, "read_registers", address, count, functioncode=4)

    def coils(self, unit, address, count):
        return self.call(unit, "read_bits", address, count, functioncode=1)

    def discretes(self, unit, address, count):
        return self.call(unit, "read_bits", address, count, functioncode=2)

    def write_one(self, unit, address, value):
        return self.call(unit, "write_register", address, value, functioncode=6)

    def write_many(self, unit, address, values):
        return self.call(unit, "write_registers", address, values)

    def write_coil_on(self, unit, address):
        return self.call(unit, "write_bit", address, 1, functioncode=5)

    def write_bits(self, unit, address, bits):
        return self.call(unit, "write_bits", address, bits)


def ask_what_every_master_can(master):
    print("SV", master.holding(PXR, 1002, 1))
    print("P I D", master.holding(PXR, 1005, 3))
    print("SV in use", master.inputs(PXR, 1001, 1))
    master.write_one(PXR, 1002, 655)
    print("SV written", master.holding(PXR, 1002, 1))
    master.write_many(DL06, 2000, [1, 2, 65535])
    print("words written", master.holding(DL06, 2000, 3))
    master.write_coil_on(DL06, 3100)
    print("coil written", master.coils(DL06, 3098, 5))
    master.write_bits(DL06, 3104, [1, 0, 1, 1, 0, 0, 0, 1, 0, 1])
    print("coils written", master.coils(DL06, 3104, 10))
    print("switches", master.discretes(DL06, 2048, 4))
    print("too many words", master.holding(PXR, 1000, 61))
    print("no such address", master.holding(PXR, 9000, 1))
    print("no such function", master.coils(PXR, 0, 1))
    print("SV above its limit", master.write_one(PXR, 1002, 9999))
    print("measured", len(master.inputs(PXR, 1000, 10)))
    print("input, unit, range, decimals", master.holding(PXR, 1015, 5))
    print("SV in 0.01 % of the range", master.holding(PXR, 2, 1))
    master.write_one(PXR, 1003, 1)
    print("standby", master.holding(PXR, 1003, 1))
    master.write_one(PXR, 1003, 0)
    master.write_many(PXR, 1056, [500, 600, 650])
    print("targets of the programme", master.holding(PXR, 1056, 4))
    print("END cannot be written", master.write_one(PXR, 1081, 3))
    print("interlocks", master.holding(DL06, 0o2003, 1))
    master.write_one(DL06, 0o2004, 0x0065)
    print("fill", [f"{word:x}" for word in master.holding(DL06, 0o2004, 1)])
    print("no such V memory", master.holding(DL06, 0o7660, 1))
    print("inputs, outputs, relays as words", [len(master.holding(DL06, first, 2)) for first in (0o40400, 0o40500, 0o40600)])
    print("a relay in its word", master.holding(DL06, 0o40602, 1)[0] & 0b11111)


def ask_what_only_pymodbus_can(master, mode):
    master.write_register(2010, 0x12, device_id=DL06)
    master.mask_write_register(address=2010, and_mask=0xF2, or_mask=0x25, device_id=DL06)
    print("masked", master.holding(DL06, 2010, 1))
    exchange = master.readwrite_registers(read_address=2010, read_count=3, write_address=2011, values=[7, 8], device_id=DL06)
    print("exchanged", exchange.registers)
    master.write_registers(2020, [2, 440, 512], device_id=DL06)
    if "rtu" not in mode:  # there pymodbus 3.16.1 takes the answer for two bytes shorter than it is
        print("queue", master.read_fifo_queue(address=2020, device_id=DL06).values)
    print("echo", master.diag_query_data(b"\xa5\x37", device_id=DL06).message)
    master.diag_clear_counters(device_id=DL06)
    print("no queue", master.read_fifo_queue(address=9000, device_id=DL06))
    print("exceptions counted", master.diag_read_bus_exception_error_count(device_id=DL06).message)
    print("messages counted", master.diag_read_device_message_count(device_id=DL06).message)
    print("done", master.diag_get_comm_event_counter(device_id=DL06).count)
    log = master.diag_get_comm_event_log(device_id=DL06)
    print("log", log.event_count, log.message_count, bytes(log.events[:6]).hex(" "))
    print("status", f"{master.read_exception_status(device_id=DL06).status & 0x81:08b}")
    print("server id", bytes(master.report_device_id(device_id=DL06).identifier[:8]))
    basic = master.read_device_information(read_code=1, object_id=0, device_id=DL06)
    print("basic", basic.information[0], basic.information[1], sorted(basic.information), basic.more_follows)
    regular = master.read_device_information(read_code=2, object_id=0, device_id=DL06)
    print("regular", sorted(regular.information), regular.more_follows, regular.next_object_id)
    rest = master.read_device_information(read_code=2, object_id=regular.next_object_id, device_id=DL06)
    print("rest", sorted(rest.information), rest.more_follows)
    print("one", master.read_device_information(read_code=4, object_id=4, device_id=DL06).information)
    print("not there", master.read_device_information(read_code=4, object_id=9, device_id=DL06))
    print("PXR has none", master.read_device_information(read_code=1, object_id=0, device_id=PXR))
    if mode != "tcp":
        master.client.write_register(1002, 500, device_id=0, no_response_expected=True)
        # The turnaround after a broadcast, which the library leaves out: without it both frames are one.
        time.sleep(0.2)
        print("broadcast", master.holding(PXR, 1002, 1), master.holding(DL06, 1002, 1))


library, mode, place = sys.argv[1:]
if library == "minimalmodbus":
    ask_what_every_master_can(Minimalmodbus(mode, place))
else:
    master = Pymodbus(mode, place)
    ask_what_every_master_can(master)
    ask_what_only_pymodbus_can(master, mode)
print("end")
