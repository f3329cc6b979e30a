"""Test rows of `check_boards.py` in which a raw-frame peer updates simulated boards."""

import time

import wire
from boards_bench import five, give_numbers, start, status
from peer import Peer
from rows import BENCH, Bench

DATE = 0x3AC1
# DSP_READY, DSP_PROGFINISHED and DSP_ERROR of boards 1 to 5.
VERDICTS = ("18", "10", "08")


def give(peer: Peer, board: int, data: bytes) -> None:
    for i in range(0, len(data), 8):
        peer.send(wire.frame(11, board, data[i:i + 8]))


def block(peer: Peer, board: int, data: bytes) -> str:
    """Sends eight frames; returns the answer."""
    give(peer, board, data)
    answer = peer.wait(*VERDICTS)
    assert answer, "nothing came after a block"
    return answer


def identity(bench: Bench, program: int, date: int) -> str:
    """Returns the bytes of Program ID and date in DSP_INFO."""
    return (wire.word(bench.order, program) + wire.word(bench.order, date)).hex().upper()


def update(bench: Bench) -> None:
    image = bytes((37 * i + 11) % 256 for i in range(1000))
    bench.same("13.3", "check values", (wire.crc16(b"123456789"), wire.crc16(image)), (0x29B1, 0x4B3F))
    if bench.order == "little":
        first = wire.header("little", 1, image, DATE).hex().upper()
        golden = "4355010001000000" "00000000F4010000" "3F4BC13AFFFFFFFF" + "F" * 16 * 4 + "FFFFFFFFFFFFDC22"
        bench.same("13.4", "header", first, golden)
    with five(bench) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 1)
        peer.ask("041#", 0.3)
        bench.same("D-T17", "status", status(peer, 1), "1F")
        for cycle in (1, 2):
            parts = (wire.header(bench.order, cycle, image, DATE), *wire.padded(image))
            answers = [block(peer, 1, part) for part in parts]
            bench.same("D-T17", f"cycle {cycle}:", answers, ["181#"] * 16 + ["181#" if cycle == 1 else "101#"])
        info = peer.answer("201#", "141#")
        bench.same("D-T17", "number, status, Program ID and date", info[8:], "011B" + identity(bench, 0x4B3F, DATE))
        bench.ok("D-T17")


# Each entry: mistake of the peer, error code, and whether memory was erased before the error.
MISTAKES = {
    "bad sum": (5, False), "wrong target": (2, False), "DLC 7": (7, False), "a pause in a block": (10, False),
    "cycle 2 first": (10, False), "address range": (2, False), "length range": (2, False),
    "cycle 2 differs": (10, False), "damaged in cycle 1": (1, False), "ninth frame in cycle 1": (4, False),
    "ninth frame while erasing": (4, True), "damaged in cycle 2": (1, True),
}


def mistake(bench: Bench, peer: Peer, name: str, image: bytes) -> bool:
    """Makes the mistake; the next frame is the error. Returns False if the peer was too slow to make the mistake."""
    order = bench.order
    first = bytearray(wire.header(order, 1, image, DATE))

    def cycle(number: int, data: bytes) -> None:
        for part in (wire.header(order, number, image, DATE), *wire.padded(data)):
            bench.same("D-T18", "READY", block(peer, 1, part), "181#")

    match name:
        case "bad sum":
            first[bench.random.randrange(64)] ^= 1 << bench.random.randrange(8)
            give(peer, 1, bytes(first))
        case "wrong target":
            give(peer, 1, wire.header(order, 1, image, DATE, target=0x77))
        case "DLC 7":
            peer.send("2C1#00000000000000")
        case "a pause in a block":
            give(peer, 1, bytes(first)[:8 * bench.random.randint(1, 7)])
            began = time.time()
            bench.same("D-T18", f"{name}:", peer.wait(*VERDICTS), "081#0A")
            late = bench.jitter.worst(began, peer.stamp)
            bench.within("D-T18", "error 10", peer.stamp - began, 0.2 / BENCH - late, 0.3 + late)
            return True
        case "cycle 2 first":
            give(peer, 1, wire.header(order, 2, image, DATE))
        case "address range":
            give(peer, 1, wire.header(order, 1, image, DATE, address=0x00FF_FFF0))
        case "length range":
            give(peer, 1, wire.header(order, 1, image, DATE, length=0x7FFF_FFFF))
        case "cycle 2 differs":
            cycle(1, image)
            give(peer, 1, wire.header(order, 2, image + b"\0\0", DATE))
        case "damaged in cycle 1" | "damaged in cycle 2":
            damaged = bytearray(image)
            damaged[bench.random.randrange(len(image))] ^= 1 << bench.random.randrange(8)
            if name.endswith("2"):
                cycle(1, image)
            parts = (wire.header(order, int(name[-1]), image, DATE), *wire.padded(bytes(damaged)))
            for part in parts[:-1]:
                bench.same("D-T18", "READY", block(peer, 1, part), "181#")
            give(peer, 1, parts[-1])
        case "ninth frame in cycle 1" | "ninth frame while erasing":
            if name.endswith("erasing"):
                cycle(1, image)
                give(peer, 1, wire.header(order, 2, image, DATE))
                time.sleep(0.01)
            else:
                give(peer, 1, bytes(first))
            give(peer, 1, b"\0" * 8)
            answer = peer.wait(*VERDICTS)
            # The board had processed the block before it received this peer's ninth frame, so the mistake did not occur.
            if answer == "181#":
                return False
            bench.same("D-T18", f"{name}:", answer, "081#04")
            return True
    bench.same("D-T18", f"{name}:", peer.wait(*VERDICTS), f"081#{MISTAKES[name][0]:02X}")
    return True


def mistakes(bench: Bench, part: int) -> None:
    """Checks every third mistake, starting with number `part`."""
    some = list(MISTAKES.items())[part::3]
    for name, (_, erased) in some:
        for tries in range(5):
            image = bench.image(128, 640)
            with bench.chain("--boards", "1") as chain, chain.peer() as peer:
                give_numbers(bench, peer, 1)
                before = peer.answer("201#", "141#")[12:]
                peer.ask("041#", 0.3)
                if not mistake(bench, peer, name, image):
                    bench.expect(tries < 4, "D-T18", f"{name}: error 4", "READY, five times")
                    continue
                late = peer.all(0.3)
                give(peer, 1, b"\0" * 64)
                late += peer.all(0.2)
                bench.same("D-T18", f"{name}: after the one error", late, [])
                bench.same("D-T18", f"{name}: status", status(peer, 1), "1F")
                peer.ask("1C1#0400", 0.1)
                after = peer.answer("201#", "141#")[12:]
                bench.same("D-T18", f"{name}: Program ID and date", after, "FFFFFFFF" if erased else before)
                answer = peer.answer("301#", "501#", "081#")
                bench.same("D-T18", f"{name}: a start", answer, "081#0B" if erased else "501#")
                break
    bench.ok("D-T18", ", ".join(name for name, _ in some))


def mistakes_1(bench: Bench) -> None:
    mistakes(bench, 0)


def mistakes_2(bench: Bench) -> None:
    mistakes(bench, 1)


def mistakes_3(bench: Bench) -> None:
    mistakes(bench, 2)


def group(bench: Bench) -> None:
    image = bench.image(128, 640)
    with five(bench) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 3)
        peer.ask("041#", 0.3)
        peer.ask("043#", 0.3)
        for cycle in (1, 2):
            parts = [wire.header(bench.order, cycle, image, DATE), *wire.padded(image)]
            for i, part in enumerate(parts):
                give(peer, 0, part)
                last = cycle == 2 and i == len(parts) - 1
                answers = sorted([peer.wait(*VERDICTS), peer.wait(*VERDICTS)])
                bench.same("D-T19", f"block {i}", answers, ["101#", "103#"] if last else ["181#", "183#"])
        bench.same("D-T19", "board 2:", peer.all(0.3), [])
        for board, done in ((1, True), (2, False), (3, True)):
            shown = peer.answer(wire.frame(8, board), f"{0x140 + board:03X}#")[12:]
            expected = identity(bench, wire.crc16(image), DATE)
            bench.same("D-T19", f"board {board} has the new program:", shown == expected, done)
        bench.ok("D-T19")


def not_asked_for(bench: Bench) -> None:
    """Checks error 2 for program data with PROG = 0, and while the application runs."""
    with five(bench) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 1)
        bench.same("PC_PROG", "with PROG = 0:", peer.ask("2C1#0000000000000000", 0.2), ["081#02"])
        bench.same("PC_PROG", "broadcast:", peer.ask("2C0#0000000000000000", 0.2), [])
        start(bench, peer)
        answers = [f for f in peer.ask("2C1#0000000000000000", 0.2) if f.startswith("081")]
        bench.same("PC_PROG", "with an application:", answers, ["081#02"])
        bench.ok("PC_PROG")


ROWS = [mistakes_1, mistakes_2, mistakes_3, update, group, not_asked_for]
