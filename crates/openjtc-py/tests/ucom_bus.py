"""Client of a chain's bus, which shares no code with the package, and simulated chains for tests."""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from openjtc import ucom

#: Identifier of MCA_ADMIN_DATA to and from board 0.
ADMIN_TO = 0x600
#: Data of MCA_ADMIN_DATA with the flags run, active, debug and global debug.
STOPPED, SAFE, ACTIVE = bytes(4), bytes([1, 0, 0, 0]), bytes([1, 1, 0, 0])
#: Frame of a PC's heartbeat.
ALIVE = (0x680, b"")


class Bus:
    """Socketcand client in raw mode. The client stores every frame as (identifier, data)."""

    def __init__(self, url: str) -> None:
        host, port, channel = re.fullmatch(r"socketcand:([^:]+):(\d+)/(\w+)", url).groups()  # type: ignore[union-attr]
        self.socket = socket.create_connection((host, int(port)))
        self.frames: list[tuple[int, bytes]] = []
        #: Time of each frame on the bus, s, by the clock of the bus server.
        self.times: list[float] = []
        self.text, self.ended = "", False
        self.thread = threading.Thread(target=self._read)
        self.thread.start()
        self.wait(lambda: "< hi >" in self.text)
        self.socket.sendall(f"< open {channel} >".encode())
        self.wait(lambda: "< ok >" in self.text)
        self.socket.sendall(b"< rawmode >")
        self.wait(lambda: self.text.count("< ok >") == 2)

    def _read(self) -> None:
        while not self.ended:
            try:
                self.text += self.socket.recv(65536).decode()
            except OSError:
                return
            for found in re.finditer(r"< frame ([0-9A-Fa-f]+) ([\d.]+) ([0-9A-Fa-f ]*)>", self.text):
                self.times.append(float(found[2]))
                self.frames.append((int(found[1], 16), bytes.fromhex(found[3].replace(" ", ""))))
            self.text = re.sub(r"< frame [^>]*>", "", self.text)

    def wait(self, condition: Callable[[], object]) -> None:
        since = time.monotonic()
        while not condition():
            assert time.monotonic() - since < 30, f"never: {self.text!r} {self.frames[-20:]}"
            time.sleep(0.002)

    def send(self, identifier: int, data: bytes = b"") -> None:
        listed = " ".join(f"{byte:02X}" for byte in data)
        self.socket.sendall(f"< send {identifier:X} {len(data)} {listed} >".encode())

    def came(self, identifier: int, data: bytes, after: int = 0) -> bool:
        """Returns True if this frame was on the bus after the first `after` frames."""
        return (identifier, data) in self.frames[after:]

    def when(self, identifier: int, data: bytes, after: int = 0) -> float:
        """Returns the time of this frame, s, by the clock of the bus server. Only frames after the first `after` frames count."""
        self.wait(lambda: self.came(identifier, data, after))
        return self.times[self.frames.index((identifier, data), after)]

    def status(self, board: int) -> int:
        """Reads the status byte in the answer of a board to PC_INFO (0x200 + number), the first frame of DSP_INFO (0x140 + number)."""
        before = len(self.frames)
        self.send(0x200 + board)

        def answers() -> list[bytes]:
            return [data for identifier, data in self.frames[before:] if identifier == 0x140 + board and len(data) == 8]

        self.wait(answers)
        return answers()[0][3]

    def runs(self, board: int) -> bool:
        """Returns bit MCARUN (0x20) of the board's status."""
        return bool(self.status(board) & 0x20)

    def started(self, board: int) -> bool:
        """Returns bit MSTART (0x80) of the board's status."""
        return bool(self.status(board) & 0x80)

    def sends_outputs(self, board: int) -> bool:
        """Returns True if sensor outputs of the board (0x380 + number) arrive within 0.1 s."""
        before = len(self.frames)
        time.sleep(0.1)
        return any(identifier == 0x380 + board for identifier, _ in self.frames[before:])

    def close(self) -> None:
        self.ended = True
        self.socket.shutdown(socket.SHUT_RDWR)
        self.thread.join()
        self.socket.close()


@pytest.fixture
def sim() -> Iterator[ucom.SimulatedChain]:
    simulated = ucom.sim(boards=3)
    yield simulated
    simulated.end()


@pytest.fixture(scope="module")
def numbered() -> Iterator[ucom.SimulatedChain]:
    """Yields a chain whose three boards have numbers, for tests that leave it unchanged."""
    simulated = ucom.sim(boards=3)
    with ucom.connect(simulated) as chain:
        chain.init()
    yield simulated
    simulated.end()


@pytest.fixture
def bus(sim: ucom.SimulatedChain) -> Iterator[Bus]:
    client = Bus(sim.url)
    yield client
    client.close()


@pytest.fixture
def numbered_bus(numbered: ucom.SimulatedChain) -> Iterator[Bus]:
    client = Bus(numbered.url)
    yield client
    client.close()
