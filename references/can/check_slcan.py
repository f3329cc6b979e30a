"""Compares python-can's slcan interface with can-link's adapter side, at a pseudo-terminal.

Needs python-can and pyserial. The example `slcan_adapter` is taken from $JTC_EXAMPLES, or else built with cargo. Exit code 0: all
agreed.
"""

import os
import random
import subprocess
import sys

import can
from example import program, received
from frames import messages

TIMEOUT_S = 120.0
BURST = 2000


def same(sent: can.Message, got: can.Message) -> None:
    for field in ("is_extended_id", "is_remote_frame", "is_fd", "bitrate_switch", "dlc"):
        assert getattr(sent, field) == getattr(got, field), f"{field}: {sent} became {got}"
    assert sent.arbitration_id + 1 == got.arbitration_id, f"{sent} became {got}"
    assert bytes(sent.data) == bytes(got.data), f"{sent} became {got}"


def check(path: str, seed: int) -> None:
    timing = can.BitTimingFd.from_sample_point(
        f_clock=80_000_000, nom_bitrate=1_000_000, nom_sample_point=80.0, data_bitrate=5_000_000, data_sample_point=75.0)
    with can.Bus(interface="slcan", channel=path, timing=timing, sleep_after_open=0) as bus:
        count = 0
        for message in messages(random.Random(seed)):
            bus.send(message)
            same(message, received(bus, TIMEOUT_S))
            count += 1
        assert bus.get_version(TIMEOUT_S) == (10, 13)
        for number in range(BURST):
            bus.send(can.Message(arbitration_id=0x100, is_extended_id=False, data=number.to_bytes(2, "big")))
            # The line between the two has a small buffer, so answers are read half-way through a burst.
            if number % 100 == 99:
                for before in range(number - 99, number + 1):
                    message = received(bus, TIMEOUT_S)
                    assert bytes(message.data) == before.to_bytes(2, "big"), message
    print(f"{path}: {count} kinds of frames and a burst of {BURST} answered alike")


def main() -> int:
    seed = int(os.environ.get("SEED", random.randrange(2**32)))
    print(f"seed {seed}")
    adapter = subprocess.Popen(program("slcan_adapter"), stdout=subprocess.PIPE, text=True)
    try:
        line = adapter.stdout.readline()
        assert line.startswith("ready: /"), line
        path = line.removeprefix("ready: ").strip()
        # A second host finds the adapter in the same state as the first one.
        for _ in range(2):
            check(path, seed)
    finally:
        adapter.terminate()
        adapter.wait()
    return 0


if __name__ == "__main__":
    sys.exit(main())
