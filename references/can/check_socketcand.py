"""Compares python-can's socketcand interface with can-link's server.

Needs python-can. The example `socketcand_server` is taken from $JTC_EXAMPLES, or else built with cargo. Exit code 0: all agreed.
"""

import logging
import os
import random
import subprocess
import sys
import threading

import can
from example import program, received

TIMEOUT_S = 120.0
BURST = 5000


def connect(port: int, channel: str) -> can.BusABC:
    return can.Bus(interface="socketcand", host="127.0.0.1", port=port, channel=channel)


def same(sent: can.Message, got: can.Message, step: int = 0) -> None:
    for field in ("is_extended_id", "is_remote_frame", "is_error_frame", "is_fd", "dlc"):
        assert getattr(sent, field) == getattr(got, field), f"{field}: {sent} became {got}"
    assert sent.arbitration_id + step == got.arbitration_id, f"{sent} became {got}"
    assert bytes(sent.data) == bytes(got.data), f"{sent} became {got}"


def check_kinds(port: int, rng: random.Random) -> None:
    """Checks both directions, every length, both widths of identifiers, and bytes from 0 to 255."""
    count = 0
    with connect(port, "can0") as bus:
        for extended, top in ((False, 0x7FF), (True, 0x1FFFFFFF)):
            for length in range(9):
                for data in (rng.randbytes(length), bytes(range(length)), bytes([255] * length)):
                    number = rng.choice([0, top - 1, rng.randrange(0, top) & ~1])
                    message = can.Message(arbitration_id=number, is_extended_id=extended, data=data, check=True)
                    bus.send(message)
                    same(message, received(bus, TIMEOUT_S), step=1)
                    count += 1
    print(f"{count} frames answered alike")


def check_two(port: int) -> None:
    """Checks two clients: each receives the other's frames once and in order, a burst without gaps, and never its own frames."""
    with connect(port, "can1") as one, connect(port, "can1") as two:
        def send() -> None:
            for number in range(BURST):
                one.send(can.Message(arbitration_id=0x100, is_extended_id=False, data=number.to_bytes(2, "big")))

        sender = threading.Thread(target=send)
        sender.start()
        for number in range(BURST):
            message = received(two, TIMEOUT_S)
            assert message.arbitration_id == 0x100 and bytes(message.data) == number.to_bytes(2, "big"), message
        sender.join()
        # If this is the first frame that `one` receives, none of its own frames came back.
        two.send(can.Message(arbitration_id=0x200, is_extended_id=False))
        message = received(one, TIMEOUT_S)
        assert message.arbitration_id == 0x200 and message.dlc == 0, message
    print(f"a burst of {BURST} frames from one client to the other")


def check_busy(port: int) -> None:
    """Checks a bus that is never quiet: a client can connect, and gets the frames without gaps.

    The server holds frames back while a client connects. A busy computer may pause longer than that between two reads. The client then
    refuses, and the check tries again.
    """
    attempts, connected = 60, 0
    for _ in range(attempts):
        try:
            bus = connect(port, "busy")
        except can.CanError as error:
            print(f"tried again: {error}")
            continue
        with bus:
            first = int.from_bytes(received(bus, TIMEOUT_S).data, "big")
            for number in range(first + 1, first + 20):
                message = received(bus, TIMEOUT_S)
                assert int.from_bytes(message.data, "big") == number, message
        connected += 1
        if connected == 20:
            print("20 connections to a busy bus")
            return
    raise AssertionError(f"only {connected} of {attempts} connections to a busy bus")


def check_unknown_bus(port: int) -> None:
    try:
        connect(port, "can9")
    except can.CanError as error:
        assert "there is can0, can1, busy" in str(error), error
        return
    raise AssertionError("a bus that is not there was opened")


def main() -> int:
    # Hides python-can's messages about a line that is cut between two reads.
    logging.getLogger("can").setLevel(logging.CRITICAL)
    seed = int(os.environ.get("SEED", random.randrange(2**32)))
    print(f"seed {seed}")
    server = subprocess.Popen([*program("socketcand_server"), "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    try:
        line = server.stdout.readline()
        assert line.startswith("ready: socketcand:127.0.0.1:"), line
        port = int(line.rsplit(":", 1)[1].split("/")[0])
        check_kinds(port, random.Random(seed))
        check_two(port)
        check_busy(port)
        check_unknown_bus(port)
    finally:
        server.terminate()
        server.wait()
    return 0


if __name__ == "__main__":
    sys.exit(main())
