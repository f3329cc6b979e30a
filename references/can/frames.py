"""Frames that the checks send."""

import random

import can

FD_LENGTHS = [*range(9), 12, 16, 20, 24, 32, 48, 64]


def messages(rng: random.Random) -> list[can.Message]:
    """Returns a message of each kind and length. Their ids are even; the ids of the answers are odd."""
    found = []
    for extended in (False, True):
        top = 0x1FFFFFFF if extended else 0x7FF

        def message(**fields) -> can.Message:
            number = rng.randrange(0, top) & ~1
            return can.Message(arbitration_id=number, is_extended_id=extended, check=True, **fields)

        for length in range(9):
            found.append(message(data=rng.randbytes(length)))
            found.append(message(is_remote_frame=True, dlc=length))
        for length in FD_LENGTHS:
            for switch in (False, True):
                found.append(message(is_fd=True, bitrate_switch=switch, data=rng.randbytes(length)))
    return found
