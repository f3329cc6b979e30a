"""Handling of program data by boards that a script plays: blocks, cycles, checks."""

import wire
from pc_board import NONE, PROG, Board


class Programming:
    """Part of `pc_boards.Boards`."""

    def transfer(self, board: Board) -> None:
        """Begins a transfer with cycle 1."""
        board.dropping, board.busy, board.block, board.blocks = False, False, b"", []
        board.serial += 1

    def fail(self, board: Board, code: int) -> None:
        self.transfer(board)
        board.dropping = True
        self.say(2, board.number, bytes([code]))

    def program_data(self, board: Board, to: int, data: bytes) -> None:
        if board.dropping:
            return
        if not board.status & PROG:
            if to:
                self.fail(board, 2)
            return
        if board.busy:
            self.early.append(f"frame of block {len(board.blocks)} before the answer to the one before")
        board.block += data
        board.serial += 1
        if len(board.block) < 64:
            return self.later(0.24, self.paused, board, board.serial)
        board.blocks.append(board.block)
        board.block, board.busy = b"", True
        head = board.blocks[0]
        if len(board.blocks) == 1 and not self.header_holds(board, head, 1):
            return None
        per_cycle = 1 + -(-2 * self.length(head) // 64)
        cycle, index = divmod(len(board.blocks) - 1, per_cycle)
        if (cycle, index) == (1, 0):
            board.program = NONE
        place = (cycle + 1, index)
        delay = self.quirks.late.get(place)
        delay = self.quirks.late_by() if delay is None else delay
        last = (cycle, index) == (1, per_cycle - 1)
        self.later(delay, self.taken, board, board.serial, place, last)

    def paused(self, board: Board, serial: int) -> None:
        if board.serial == serial:
            self.fail(board, 10)

    def length(self, head: bytes) -> int:
        return wire.number(self.quirks.order, head[12:14]) | wire.number(self.quirks.order, head[14:16]) << 16

    def header_holds(self, board: Board, head: bytes, cycle: int) -> bool:
        words = [wire.number(self.quirks.order, head[i:i + 2]) for i in range(0, 64, 2)]
        code = 0
        if words[0] != 0x5543 or words[1] != 1 or sum(words) & 0xFFFF:
            code = 5
        elif words[2] != cycle:
            code = 10
        elif words[10] not in (board.flash, 0xFFFF):
            code = 2
        if code:
            self.complaints.append(f"header {head.hex()}: error {code}")
            self.fail(board, code)
        return not code

    def taken(self, board: Board, serial: int, place: tuple[int, int], last: bool) -> None:
        if board.serial != serial:
            return
        board.busy = False
        code = board.once.pop(place, self.quirks.errors.get(place))
        if code is not None:
            self.fail(board, code)
        elif last:
            self.written(board, place[1] + 1)
        else:
            self.say(6, board.number)

    def written(self, board: Board, per_cycle: int) -> None:
        order, first, second = self.quirks.order, board.blocks[:per_cycle], board.blocks[per_cycle:]
        if not self.header_holds(board, second[0], 2):
            return
        length = 2 * self.length(first[0])
        image = b"".join(first[1:])[:length]
        if image != b"".join(second[1:])[:length]:
            self.complaints.append("the cycles carry different images")
        if wire.crc16(image) != wire.number(order, second[0][16:18]):
            self.complaints.append("the header's Program ID is not that of the image")
            return self.fail(board, 1)
        self.image = image
        new = (wire.crc16(image), wire.number(order, second[0][18:20]))
        board.program = (0x1234, 0x386E) if self.quirks.keeps_old else new
        board.status &= ~PROG
        self.transfer(board)
        if not self.quirks.lost_finished:
            self.say(4, board.number)
