"""First steps of the test rows that use simulated boards."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

import wire
from peer import Chain, Peer
from rows import Bench

FLASH = "0x21,0x42,0x63,0x04,0x7F"


def status(peer: Peer, board: int) -> str:
    """Returns the status byte from the answer to PC_INFO. Skips process data of running boards before it."""
    return peer.answer(wire.frame(8, board), f"{0x140 + board:03X}#")[10:12]


def give_numbers(bench: Bench, peer: Peer, boards: int) -> None:
    """Resets all boards and gives numbers to the first ones."""
    peer.ask("000#", 0.6)
    for board in range(1, boards + 1):
        number = f"{board:02X}"
        bench.same("D-T4", "acknowledgement", peer.answer(wire.frame(10, board), "0"), f"{0xC0 + board:03X}#{number}")
        peer.ask(wire.frame(7, board, b"\x02\x02"), 0.03)


def start(bench: Bench, peer: Peer) -> None:
    """Starts the application of board 1."""
    give_numbers(bench, peer, 1)
    bench.same("D-T9", "MCA_DSP_READY", peer.answer("301#", "501#"), "501#")
    peer.all(0.1)


def five(bench: Bench) -> Chain:
    return bench.chain("--boards", "5", "--flash-ids", FLASH)


@contextmanager
def chain_of(bench: Bench, boards: str) -> Iterator[Chain]:
    """Starts a chain whose file has this text."""
    with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
        file.write(boards)
        file.flush()
        with bench.chain("--chain", file.name) as chain:
            yield chain
