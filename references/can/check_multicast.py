"""Compares python-can's udp_multicast interface with can-link's: every frame is echoed as it was sent.

Needs python-can and msgpack. The example `echo` is taken from $JTC_EXAMPLES, or else built with cargo. Frames
stay on this host (hop limit 0). Exit code 0: all agreed.
"""

import os
import random
import socket
import subprocess
import sys
import time

import can
from example import program
from frames import messages

GROUPS = ["239.74.163.9", "ff15::7079:7468:9"]
TIMEOUT_S = 10.0


def echoed(bus: can.BusABC) -> can.Message:
    """Returns the next message of the other side (python-can also receives its own messages)."""
    end = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end:
        try:
            message = bus.recv(TIMEOUT_S)
        except can.CanOperationError:
            continue  # the noise, which python-can reports
        if message is not None and message.arbitration_id & 1:
            return message
    raise AssertionError("no echo came")


def differences(sent: can.Message, heard: can.Message) -> list[str]:
    pairs = {
        "id": (sent.arbitration_id + 1, heard.arbitration_id),
        "data": (bytes(sent.data), bytes(heard.data)),
    }
    for field in ("is_extended_id", "is_remote_frame", "is_fd", "bitrate_switch", "dlc", "is_error_frame"):
        pairs[field] = (getattr(sent, field), getattr(heard, field))
    return [f"{name}: {a!r} became {b!r}" for name, (a, b) in pairs.items() if a != b]


def send_noise(group: str, port: int) -> None:
    six = ":" in group
    with socket.socket(socket.AF_INET6 if six else socket.AF_INET, socket.SOCK_DGRAM) as sender:
        if six:
            sender.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_HOPS, 0)
        else:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sender.sendto(b"noise", (group, port))


def check(group: str, port: int, seed: int) -> None:
    host = f"[{group}]" if ":" in group else group
    echo = subprocess.Popen([*program("echo"), f"multicast:{host}:{port}"], stdout=subprocess.PIPE, text=True)
    try:
        assert echo.stdout.readline().startswith("ready:"), "the example did not start"
        with can.Bus(interface="udp_multicast", channel=group, port=port, hop_limit=0) as bus:
            count = 0
            for message in messages(random.Random(seed)):
                bus.send(message)
                wrong = differences(message, echoed(bus))
                assert not wrong, f"{message}: {wrong}"
                count += 1
            # Noise is skipped, and the frames after it are echoed.
            send_noise(group, port)
            # A burst stays in order and complete as long as it fits into the receive buffers.
            burst = [can.Message(arbitration_id=0x100, is_extended_id=False, is_fd=True, bitrate_switch=True,
                                 data=number.to_bytes(2, "big")) for number in range(50)]
            for message in burst:
                bus.send(message)
            for message in burst:
                wrong = differences(message, echoed(bus))
                assert not wrong, f"burst: {message}: {wrong}"
    finally:
        echo.terminate()
        echo.wait()
    print(f"{group}: {count} kinds of frames and a burst of {len(burst)} echoed alike")


def has_multicast(group: str, port: int) -> bool:
    try:
        with can.Bus(interface="udp_multicast", channel=group, port=port, hop_limit=0) as bus:
            bus.send(can.Message(arbitration_id=0, is_extended_id=False))
            return bus.recv(2.0) is not None
    except (can.CanError, OSError) as error:
        print(f"{group}: {error}")
        return False


def main() -> int:
    seed = int(os.environ.get("SEED", random.randrange(2**32)))
    print(f"seed {seed}")
    port = random.randrange(20_000, 60_000)
    usable = [group for group in GROUPS if has_multicast(group, port)]
    for group in GROUPS:
        if group in usable:
            check(group, port, seed)
        else:
            print(f"skipped: this host has no multicast for {group}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
