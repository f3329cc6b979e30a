"""A chain of boards that a script plays, written only from the protocol's tables."""

import heapq
import itertools
import math
import threading
import time
from collections.abc import Callable

import wire
from pc_board import EXLRUN, INIT, IPINIT, MCARUN, MSTART, NONE, OPINIT, PROG, Board, Quirks
from pc_programming import Programming
from peer import Peer


class Boards(threading.Thread, Programming):
    """A chain on a bus, with a list of all received and sent frames and their times."""

    def __init__(self, peer: Peer, flash: list[int], quirks: Quirks, shape=(2, 4, 3), numbered=False, running=0):
        super().__init__(daemon=True)
        self.peer, self.quirks = peer, quirks
        self.boards = [Board(i, one, shape) for i, one in enumerate(flash)]
        for board in self.boards if numbered else ():
            board.number, board.status = board.place + 1, EXLRUN | INIT | OPINIT
        self.heard: list[tuple[float, str]] = []
        self.said: list[tuple[float, str]] = []
        self.early: list[str] = []  # program data before the answer to the previous block
        self.complaints: list[str] = []
        self.attempts = 0
        self.waits: list[tuple[float, int, Callable]] = []
        self.count = itertools.count()
        self.lock = threading.Lock()
        self.ending = threading.Event()
        self.broken: Exception | None = None
        for board in self.boards[:running]:
            board.status = MSTART | INIT | OPINIT
            self.later(0.1, self.alive, board)

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.end()

    def run(self) -> None:
        try:
            while not self.ending.is_set():
                self.turn()
        except Exception as e:
            self.broken = e

    def turn(self) -> None:
        """Performs due actions, and handles a frame if one arrives."""
        while (act := self.due()) is not None:
            act()
        with self.lock:
            due = self.waits[0][0] if self.waits else math.inf
        frame = self.peer.next(min(max(0.0, due - time.monotonic()), 0.05))
        if frame is not None:
            self.heard.append((self.peer.stamp, frame))
            self.answer(*wire.parts(frame))

    def due(self) -> Callable | None:
        with self.lock:
            if self.waits and self.waits[0][0] <= time.monotonic():
                return heapq.heappop(self.waits)[2]
        return None

    def end(self) -> list[str]:
        """Ends the boards; returns the received frames."""
        self.ending.set()
        self.join()
        if self.broken is not None:
            raise RuntimeError("the script's boards broke") from self.broken
        return self.frames()

    def frames(self, *starts: str) -> list[str]:
        return [frame for _, frame in list(self.heard) if frame.startswith(starts or ("",))]

    def times(self, start: str) -> list[float]:
        """Returns the times at which frames that begin with `start` were received."""
        return [at for at, frame in list(self.heard) if frame.startswith(start)]

    def later(self, seconds: float, act: Callable, *arguments) -> None:
        """Schedules an action of the boards, from any thread."""
        with self.lock:
            heapq.heappush(self.waits, (time.monotonic() + seconds, next(self.count), lambda: act(*arguments)))

    def say(self, function: int, sequence: int, data: bytes = b"") -> None:
        if any(board.mute and board.number == sequence for board in self.boards):
            return
        frame = wire.frame(function, sequence, data)
        self.said.append((self.peer.send(frame), frame))

    def words(self, *words: int) -> bytes:
        return b"".join(wire.word(self.quirks.order, w) for w in words)

    def answer(self, function: int, to: int, data: bytes) -> None:
        if self.quirks.strict and data and function in (0, 1, 8, 9, 10, 12):
            return
        if function in (0, 9):
            for board in self.boards:
                if to in (0, board.number):
                    if function == 0:
                        self.forget(board)
                    self.later((board.flash & 0x7F) * 1e-3 + 0.005, self.report, board)
        elif function == 10:
            self.initialise(to)
        for board in self.boards:
            if board.number is not None and not board.silent and to in (0, board.number):
                self.numbered(board, function, to, data)

    def crash(self, board: Board) -> None:
        """Reboots the board without a request."""
        self.forget(board)
        self.report(board)

    def forget(self, board: Board) -> None:
        board.number, board.status, board.dropping, board.busy, board.block = None, EXLRUN, False, False, b""
        board.serial += 1

    def report(self, board: Board) -> None:
        for k in range(4) if self.quirks.all4 else [board.flash >> 5 & 3]:
            self.say(16 + k, board.flash & 0x1F, bytes([board.flash & 0xFF]))

    def pin(self, board: Board) -> bool:
        return board.place == 0 or bool(self.boards[board.place - 1].status & OPINIT)

    def initialise(self, number: int) -> None:
        for board in self.boards:
            if board.number == number or (board.number is None and self.pin(board)):
                board.number = number
                board.status |= INIT | (OPINIT if self.quirks.auto_pin else 0)
                if self.quirks.lost_acks > 0:
                    self.quirks.lost_acks -= 1
                else:
                    self.say(3, number, bytes([number + self.quirks.wrong_ack]))
                return

    def numbered(self, board: Board, function: int, to: int, data: bytes) -> None:
        started = board.status & MSTART
        match function:
            case 1:
                board.status = board.status & ~(MSTART | MCARUN) | EXLRUN | PROG
                self.attempts += 1
                self.transfer(board)
            case 7:
                self.set_status(board, *data[:2])
            case 8:
                self.describe(board)
            case 11:
                self.program_data(board, to, data)
            case 12:
                self.start_application(board)
            case 21 if started:
                self.run_loop(board, True)
            case 22 if started and not data:
                self.dump(board)
            case 23 if started:
                for package in wire.packages(self.quirks.order, board.initial()):
                    self.say(27, board.number, package)
            case 24 if started and len(data) >= 4 and max(data[:4]) <= 1:
                board.flags = bytes([data[0], data[0] & data[1], *data[2:4]])
                self.run_loop(board, bool(data[0]))

    def set_status(self, board: Board, mask: int, value: int) -> None:
        if mask & OPINIT and self.quirks.lost_pins > 0:
            self.quirks.lost_pins -= 1
            return
        old, mirrors = board.status, MCARUN | EXLRUN | IPINIT
        board.status = (old & ~mask | value) & ~mirrors | old & mirrors
        if (board.status & ~old & PROG) or (old & ~board.status & PROG):
            self.transfer(board)
        if old & ~board.status & MSTART:
            board.status = board.status & ~MCARUN | EXLRUN
        if not board.status & INIT:
            self.forget(board)

    def describe(self, board: Board) -> None:
        inside = board.number + self.quirks.other_number
        status = board.status | (IPINIT if self.pin(board) else 0)
        head = self.words(board.flash) + bytes([inside, status]) + self.words(*board.program)
        for payload in (head, *wire.string(self.quirks.order, board.names()[0], self.quirks.inclusive)):
            self.say(5, board.number, payload)

    def start_application(self, board: Board) -> None:
        if board.program == NONE:
            return self.say(2, board.number, b"\x0b")
        if not board.status & MSTART:
            board.status = board.status & ~(EXLRUN | PROG) | MSTART
            board.flags = bytes(4)
            self.later(0.0, self.alive, board)
        self.say(20, board.number)

    def alive(self, board: Board) -> None:
        """Sends a heartbeat, and again every second while the application is up."""
        if board.status & MSTART and board.number is not None:
            if not board.silent:
                self.say(26, board.number)
            self.later(1.0, self.alive, board)

    def run_loop(self, board: Board, on: bool) -> None:
        if on and not board.status & MCARUN:
            self.later(0.01, self.outputs, board, 0)
        board.status = board.status | MCARUN if on else board.status & ~MCARUN
        board.flags = bytes([on, on and board.flags[1], *board.flags[2:]])
        # The answer is delayed, because both sides use the same identifier.
        self.later(0.003, self.say, 24, board.number, board.flags)

    def outputs(self, board: Board, turn: int) -> None:
        if board.status & MCARUN:
            self.later(0.01, self.outputs, board, turn + 1)
            if not board.silent:
                buffer = [board.number << 8 | (turn + i) & 0xFF for i in range(board.shape[1])]
                for package in wire.packages(self.quirks.order, buffer):
                    self.say(14, board.number, package)

    def dump(self, board: Board) -> None:
        frames = [self.words(*board.shape)]
        for text in board.names():
            frames += wire.string(self.quirks.order, text, self.quirks.inclusive)
        for i, payload in enumerate(frames):
            self.later(i * self.quirks.dump_gap, self.dumped, board, payload)

    def dumped(self, board: Board, payload: bytes) -> None:
        self.say(22, board.number, payload)
        for frame in self.quirks.between():
            self.said.append((self.peer.send(frame), frame))
