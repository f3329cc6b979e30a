"""Checks `jtc sim` with a separate host program on pyserial, which shares no code with the project and is written from the protocol page
only.

usage: check_serial_host.py JTC

JTC is the command `jtc`. The host behaves as the known hosts do: it waits for the one-shot record of each frame, sends segments of 500
points, polls the trajectory state, and reads a status by its offsets. Needs pyserial.
"""

import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

import serial

STATES = ["Start", "Init", "HoldPos", "Operate", "Teaching", "Error"]
PATIENCE_S = 60.0


def crc(data):
    register = 0
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1) ^ 0x1021 if register & 0x8000 else register << 1
        register &= 0xFFFF
    return register


def frame(kind, body=b""):
    head = bytes([0x9B, kind]) + struct.pack(">H", len(body) + 6) + body
    return head + struct.pack(">H", crc(head))


class Status:
    """Bytes of a JtcStatus, read at the offsets that existing hosts use."""

    def __init__(self, data):
        self.record = (data[4], data[5], data[6], struct.unpack_from(">H", data, 7)[0])
        self.state = STATES[data[9]]
        self.errors = struct.unpack_from(">H", data, 10)[0]
        self.missing = data[14]
        self.tes = data[16]
        self.point = struct.unpack_from(">I", data, 17)[0]
        self.position = [struct.unpack_from(">f", data, 31 + 22 * j + 9)[0] for j in range(6)]


class Host:
    def __init__(self, path):
        self.port = serial.Serial(path, 115200, timeout=0.05)
        self.held = b""
        self.statuses = 0

    def status(self):
        """Returns the next status. Any other data are an error."""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            while len(self.held) >= 4:
                assert self.held[:2] == b"\x9b\x03", f"no status begins here: {self.held[:8].hex(' ')}"
                length = struct.unpack_from(">H", self.held, 2)[0]
                assert length == 175, f"a status of {length} bytes"
                if len(self.held) < length:
                    break
                data, self.held = self.held[:length], self.held[length:]
                assert crc(data) == 0, "CRC of a status"
                self.statuses += 1
                found = Status(data)
                assert found.tes <= 4 and found.record[1] <= 5, "a code that existing hosts do not know"
                return found
            self.held += self.port.read(max(1, self.port.in_waiting))
        raise AssertionError("the controller is silent")

    def ask(self, data, expect=(1, 1)):
        """Sends a frame and waits for its record, which must come exactly once."""
        self.port.write(data)
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            status = self.status()
            if status.record[0] or status.record[1]:
                wanted = (data[1], *expect, len(data))
                assert status.record == wanted, f"record {status.record} instead of {wanted}"
                return status
        raise AssertionError(f"no record of {data[:8].hex(' ')}")

    def until(self, what, reached):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            status = self.status()
            assert status.record[:3] == (0, 0, 0), f"a record nobody asked for: {status.record}"
            assert status.state != "Error", f"error word {status.errors:#06x} while waiting for {what}"
            if reached(status):
                return status
        raise AssertionError(f"never reached: {what}")


def motion():
    """Returns 2 s of a smooth swing of all joints, one point every 2 ms: 1,001 points."""
    points = []
    for i in range(1001):
        t = i * 0.002
        omega = math.pi
        row = []
        for amplitude in (0.3, -0.2, 0.25, 0.3, -0.3, 0.4):
            u, s, c = 1 - math.cos(omega * t), math.sin(omega * t), math.cos(omega * t)
            row.append((amplitude * u * u / 4, amplitude * omega * u * s / 2, amplitude * omega**2 * (s * s + u * c) / 2))
        raw = [round(p / 3.141592 * 32767) for p, _, _ in row]
        raw += [round(v / 6.283185 * 32767) for _, v, _ in row]
        raw += [round(a / 12.566370 * 32767) for _, _, a in row]
        points.append(struct.pack(">18h", *raw))
    return points


def session(host):
    status = host.until("Init", lambda s: s.state == "Init")
    assert status.missing == 0b111, "nothing was given yet, and friction, PID and model are missing"
    for kind in (0x0F, 0x08, 0x0A):
        host.ask(frame(kind))
    host.until("HoldPos", lambda s: s.state == "HoldPos")
    # Frames that are refused: a wrong CRC, an unknown type, a trajectory that begins in its middle, an Execute without a trajectory.
    broken = bytearray(frame(0x08))
    broken[-1] ^= 1
    host.ask(bytes(broken), expect=(4, 0))
    points = motion()
    head = lambda segment, segments: struct.pack(">4H", 3, segment, segments, 2)
    host.ask(frame(0x04, head(1, 3) + points[0]), expect=(1, 4))
    # Existing hosts do not know data statuses above 6 (J-51), so for them "not allowed" is 6.
    host.ask(frame(0x0B, b"\x03"), expect=(1, 6))
    chunks = [b"".join(points[i : i + 500]) for i in range(0, len(points), 500)]
    for number, chunk in enumerate(chunks):
        status = host.ask(frame(0x04, head(number, len(chunks)) + chunk))
    host.until("the whole trajectory", lambda s: s.tes == 1)
    host.ask(frame(0x0B, b"\x03"))
    largest, last = 0.0, 0

    def finished(status):
        nonlocal largest, last
        assert status.point >= last, "the point index went back"
        largest, last = max(largest, abs(status.position[5])), status.point
        return status.tes == 4

    status = host.until("the end of the motion", finished)
    assert status.state == "HoldPos" and status.point == 2000, (status.state, status.point)
    assert largest > 0.3, f"the arm moved by {largest} rad only"
    assert all(abs(q) < 0.005 for q in status.position), f"it did not come back: {status.position}"
    # The 6-byte ClearCurrentErrors of an existing host.
    host.ask(frame(0x01))


def main():
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "jtc"
        sim = subprocess.Popen([sys.argv[1], "sim", "--serial", path, "--no-throttle"], stdout=subprocess.PIPE, text=True)
        try:
            ready = sim.stdout.readline().strip()
            assert ready == f"ready: {path}", f"`jtc sim` said {ready!r}"
            host = Host(str(path))
            session(host)
            print(f"{host.statuses} statuses, every frame answered once")
            host.port.close()
            sim.terminate()
            assert sim.wait(timeout=10) == 0, "SIGTERM ends the simulator with 0"
            assert not path.is_symlink(), "the path is left behind"
        finally:
            sim.kill()
            sim.wait()


main()
