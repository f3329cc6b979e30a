"""The `ucom` command against boards that this script plays on python-can's socketcand interface.

Argument: the `ucom` program. Exit code 0: all agreed. The boards here are a few lines of their own, with nothing of the
project's code; a bus without boards (`ucom sim --boards 0`) connects the two.
"""

import json
import pathlib
import sys
import threading

import cantools

from check_boards import crc16
from peer import Chain, Peer


class Boards(threading.Thread):
    """A chain of boards without applications, and all that they heard."""

    def __init__(self, peer: Peer, flash: list[int], quirks: set[str] = frozenset()):
        super().__init__(daemon=True)
        self.peer, self.flash, self.quirks = peer, flash, quirks
        self.number = [None] * len(flash)
        self.status = [0x10] * len(flash)
        self.program = [(0x1234, 0x386E)] * len(flash)
        self.blocks: list[bytes] = []
        self.block = b""
        self.heard: list[str] = []
        self.ending = threading.Event()

    def run(self) -> None:
        while not self.ending.is_set():
            frame = self.peer.next(0.05)
            if frame is not None:
                self.heard.append(frame)
                self.answer(frame)

    def end(self) -> list[str]:
        self.ending.set()
        self.join()
        return self.heard

    def pin(self, i: int) -> bool:
        return i == 0 or bool(self.status[i - 1] & 2)

    def answer(self, frame: str) -> None:
        number, data = frame.split("#")
        function, board = int(number, 16) >> 6, int(number, 16) & 31
        data = bytes.fromhex(data)
        if function in (0, 9) and board == 0:
            if function == 0:
                self.number, self.status = [None] * len(self.flash), [0x10] * len(self.flash)
            for flash in self.flash:
                self.peer.send(f"{0x400 | (flash >> 5 & 3) << 6 | flash & 31:03X}#{flash & 255:02X}")
        elif function == 10:
            self.initialise(board)
        elif board in self.number:
            self.numbered(self.number.index(board), function, board, data)

    def initialise(self, board: int) -> None:
        for i in range(len(self.flash)):
            if self.number[i] == board or (self.number[i] is None and self.pin(i)):
                self.number[i] = board
                self.status[i] |= 8
                if "lost-ack" in self.quirks:
                    self.quirks = self.quirks - {"lost-ack"}
                elif "wrong-ack" in self.quirks:
                    self.peer.send(f"{0xC0 + board:03X}#{board + 1:02X}")
                else:
                    self.peer.send(f"{0xC0 + board:03X}#{board:02X}")
                return

    def numbered(self, i: int, function: int, board: int, data: bytes) -> None:
        if function == 8:
            program, date = self.program[i]
            words = [self.flash[i].to_bytes(2, "little"), bytes([board, self.status[i] | self.pin(i)])]
            words += [program.to_bytes(2, "little"), date.to_bytes(2, "little")]
            self.peer.send(f"{0x140 + board:03X}#{b''.join(words).hex()}")
            self.peer.send(f"{0x140 + board:03X}#0100")
            self.peer.send(f"{0x140 + board:03X}#{b'python'.hex()}")
        elif function == 7:
            mask, value = data[0], data[1]
            self.status[i] = (self.status[i] & ~mask & 0xFF | value) & ~1
        elif function == 1:
            self.status[i] |= 4
            self.block, self.blocks = b"", []
        elif function == 11:
            self.program_data(i, board, data)

    def program_data(self, i: int, board: int, data: bytes) -> None:
        self.block += data
        if len(self.block) < 64:
            return
        self.blocks.append(self.block)
        self.block = b""
        if "error-2a" in self.quirks:
            self.peer.send(f"{0x080 + board:03X}#2A")
            self.blocks = []
            return
        head = self.blocks[0]
        length = 2 * int.from_bytes(head[12:16], "little")
        cycle = 1 + -(-length // 64)
        if len(self.blocks) < 2 * cycle:
            self.peer.send(f"{0x180 + board:03X}#")
            return
        image = b"".join(self.blocks[cycle + 1:])[:length]
        assert image == b"".join(self.blocks[1:cycle])[:length], "both cycles carry the image"
        assert crc16(image) == int.from_bytes(head[16:18], "little"), "the header's Program ID is that of the image"
        if "keeps-old" not in self.quirks:
            self.program[i] = (crc16(image), int.from_bytes(head[18:20], "little"))
        self.status[i] &= ~4
        if "lost-finished" not in self.quirks:
            self.peer.send(f"{0x100 + board:03X}#")


def play(chain: Chain, flash: list[int], quirks: set[str], *words: str) -> tuple[int, dict, list[str], Boards]:
    """A command against boards: exit code, its JSON, what the boards heard."""
    with chain.peer() as peer:
        boards = Boards(peer, flash, quirks)
        boards.start()
        if words[0] != "init":
            init = chain.start("init", "--renew")
            init.communicate(timeout=60)
            del boards.heard[:]
        command = chain.start(*words)
        out, err = command.communicate(timeout=120)
        heard = boards.end()
    return command.returncode, json.loads(out), heard, boards


def scan(chain: Chain) -> None:
    code, said, heard, _ = play(chain, [0x21, 0x42], set(), "scan")
    assert code == 0 and [b["flash_number"] for b in said["boards"]] == [0x21, 0x42], said
    assert all(f == "240#" or f[:2] in ("20", "21") for f in heard), f"P-1: {heard}"


def init(chain: Chain) -> None:
    for count in (1, 3):
        code, said, heard, _ = play(chain, [0x21, 0x42, 0x63][:count], set(), "init", "--renew")
        assert code == 0 and len(said["boards"]) == count, f"P-2: {said}"
        assert f"{0x280 + count + 2:03X}#" not in heard, "P-2: the end of the chain is the end"
    code, said, heard, _ = play(chain, [0x21, 0x42], {"lost-ack"}, "init", "--renew")
    assert code == 0 and len(said["boards"]) == 2, f"P-3: {said}"
    first, then = heard.index("281#"), heard.index("201#")
    assert then > first and "281#" not in heard[first + 1:then], "P-3: PC_INFO before any repeat"
    code, said, _, _ = play(chain, [0x21], {"wrong-ack"}, "init", "--renew")
    assert code != 0 and not said["boards"], f"P-4: {said}"
    assert "says number 2" in str(said["findings"]), f"P-4: {said}"


def update(chain: Chain) -> None:
    image = bytes((37 * i + 11) % 256 for i in range(1000))
    path = pathlib.Path(chain.path("image.bin"))
    path.write_bytes(image)
    words = ("update", "1", str(path), "--date", "2009-06-01")

    code, said, heard, boards = play(chain, [0x21], set(), *words)
    assert code == 0 and said["outcome"] == "verified" and boards.program == [(0x4B3F, 0x3AC1)], said
    golden = ["2C1#4355010001000000", "2C1#00000000F4010000", "2C1#3F4BC13A2100FFFF"]
    data = [frame for frame in heard if frame.startswith("2C1")]
    assert data[:2] == golden[:2] and data[2][:12] == "2C1#3F4BC13A", f"13.4: {data[:3]}"
    assert data[8] == "2C1#0B30557A9FC4E90E" and len(data) == 2 * 136, "13.4"

    code, said, heard, _ = play(chain, [0x21], set(), *words, "--flash-id", "0x42")
    assert code == 4 and not [f for f in heard if f.startswith(("041", "2C1"))], f"P-5: {said}"

    code, said, _, _ = play(chain, [0x21], {"lost-finished"}, *words)
    assert code == 0 and said["outcome"] == "verified", f"P-9: {said}"

    code, said, _, _ = play(chain, [0x21], {"keeps-old"}, *words)
    assert code == 5 and said["outcome"] != "verified", f"P-10: {said}"

    code, said, heard, _ = play(chain, [0x21], {"error-2a"}, *words)
    assert code in (1, 5) and "42" in str(said["boards"]), f"P-18: {said}"
    assert heard.count("041#") == 3, "an unknown error: three attempts"


def dbc(program: str) -> None:
    """P-21: cantools reads the exported file, and a recorded frame, as the tool does."""
    with Chain(program, "--boards", "1") as chain, chain.peer() as peer:
        for words in (("init", "--renew"), ("start", "1")):
            assert chain.start(*words).wait(60) == 0
        path = chain.path("chain.dbc")
        assert chain.start("dbc", "1", "--out", path).wait(60) == 0
        database = cantools.database.load_file(path)
        assert chain.start("ci", "1", "set_position=1234", "--for", "1.0").wait(60) == 0
        frames = peer.all(0.5)
        log = pathlib.Path(chain.path("bus.log"))
        log.write_text("".join(f"(0.0) can0 {frame}\n" for frame in frames))
        decode = chain.start("decode", str(log))
        ours = [json.loads(line) for line in decode.communicate(timeout=60)[0].splitlines()]
        compared = 0
        for frame, line in zip(frames, ours, strict=True):
            if not frame.startswith("381#"):
                continue
            theirs = database.decode_message(0x381, bytes.fromhex(frame.split("#")[1]))
            offset = theirs.pop(next(key for key in theirs if "offset" in key.lower()))
            assert int(offset) == line["offset"], (theirs, line)
            assert [int(value) for value in theirs.values()] == line["words"][: len(theirs)], (theirs, line)
            compared += 1
        assert compared > 50, f"P-21: {compared} frames"
        print(f"dbc: {compared} frames read alike")


def main() -> None:
    program = sys.argv[1]
    for row in (scan, init, update):
        with Chain(program, "--boards", "0") as chain:
            row(chain)
        print(f"{row.__name__}: agreed")
    dbc(program)


if __name__ == "__main__":
    main()
