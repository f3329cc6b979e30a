"""Checks `ucom scan`, `init` and `dbc` with boards that this script plays on python-can's socketcand interface.

Argument: the `ucom` program. Exit code 0: all agreed. The boards use no code of the project. A bus without boards (`ucom sim --boards 0`)
connects the two. Updates, running boards and probes are in separate scripts.
"""

import json
import time

import cantools

import rows
import wire
from pc_board import MCARUN, OPINIT
from pc_play import boards, told
from rows import Bench


def scan(bench: Bench) -> None:
    flash = bench.flash_ids(3)
    with bench.bus() as chain, boards(bench, chain, flash, numbered=True, running=3) as played:
        for board in played.boards:
            board.status |= MCARUN
            played.later(0.0, played.outputs, board, 0)
        said = told(bench, "P-1", chain.start("scan"), 0)
        heard = played.end()
        running = len([frame for _, frame in played.said if frame.startswith("38")])
        bench.same("P-1", "flash numbers", [b["flash_number"] for b in said["boards"]], flash)
        odd = [f for f in heard if f != "240#" and not (f.endswith("#") and int(f[:3], 16) >> 6 == 8)]
        bench.same("P-1", "frames other than 240# and PC_INFO:", odd, [])
        bench.ok("P-1", f"{running} frames of running boards beside it")


def init(bench: Bench) -> None:
    for count in (0, 1, 31):
        flash = bench.flash_ids(count)
        with bench.bus() as chain, boards(bench, chain, flash) as played:
            command = chain.start("init", "--renew")
            said = told(bench, "P-2", command, 0 if count else (1, 3, 5))
            played.end()
            numbers = [(b["number"], b["flash_number"]) for b in said.get("boards", [])]
            bench.same("P-2", f"{count} boards: numbers", numbers, list(enumerate(flash, 1)))
            bench.same("P-2", "boards' own numbers", [b.number for b in played.boards], list(range(1, count + 1)))
            beyond = played.frames("2A0#", f"{0x280 + count + 2:03X}#") if count < 30 else played.frames("2A0#")
            bench.same("P-2", "PC_INIT beyond the end of the chain:", beyond, [])
            if count < 31:
                first, last = played.times(f"{0x280 + count + 1:03X}#")[0], played.heard[-1][0]
                late = bench.jitter.worst(first, last)
                bench.within("P-2", "the end of the chain", last - first, 0.0, 1.0 * rows.BENCH + late)
    flash = bench.flash_ids(3)
    with bench.bus() as chain, boards(bench, chain, flash, lost_pins=1) as played:
        said = told(bench, "P-2", chain.start("init", "--renew"), 0)
        bench.same("P-2", "PC_SETSTATUS lost once: boards", [b["flash_number"] for b in said["boards"]], flash)
    bench.ok("P-2", "0, 1, 31 boards; PC_SETSTATUS lost")


def acknowledgements(bench: Bench) -> None:
    for count, lost in ((1, 1), (2, 1), (2, 2)):
        flash = bench.flash_ids(count)
        with bench.bus() as chain, boards(bench, chain, flash, lost_acks=lost, auto_pin=True) as played:
            said = told(bench, "P-3", chain.start("init", "--renew"), 0)
            heard = played.end()
            bench.same("P-3", "boards", len(said["boards"]), count)
            for number in range(1, count + 1):
                ask, repeat = wire.frame(8, number), wire.frame(10, number)
                first = heard.index(repeat)
                again = heard.index(repeat, first + 1) if repeat in heard[first + 1:] else len(heard)
                bench.expect(ask in heard[first:again], "P-3", f"{ask} before any other {repeat}", heard[first:])
            bench.same("P-3", "numbers", [b.number for b in played.boards], list(range(1, count + 1)))
    bench.ok("P-3")
    with bench.bus() as chain, boards(bench, chain, bench.flash_ids(1), wrong_ack=True) as played:
        said = told(bench, "P-4", chain.start("init", "--renew"), (1, 3, 4, 5))
        refused = not said["boards"] and "contains number 2" in str(said["findings"])
        bench.expect(refused, "P-4", "the board is refused and the numbers are named", said)
    bench.ok("P-4")


def repair(bench: Bench) -> None:
    """5.4: the pin of board 2 is switched off three times before PC_INIT(2). The number of another board is never given."""
    flash = bench.flash_ids(3)
    for deaf_master in (False, True):
        with bench.bus() as chain, boards(bench, chain, flash) as played:
            told(bench, "repair", chain.start("init", "--renew"), 0)
            del played.heard[:]
            played.later(0.0, played.crash, played.boards[2 if deaf_master else 1])
            # Board 2 works, but its frames are lost. Board 3 has lost its number. Board 3 must not get number 2.
            played.boards[1].mute = deaf_master
            time.sleep(0.3)
            said = told(bench, "repair", chain.start("repair", "2"), (1, 3, 4, 5) if deaf_master else 0)
            frames = played.frames("1C2", "282")
            bench.same("repair", "first frames", frames[:4], ["1C2#0200"] * 3 + ["282#"])
            numbers = [board.number for board in played.boards]
            bench.same("repair", "numbers", numbers, [1, 2, None] if deaf_master else [1, 2, 3])
            if not deaf_master:
                bench.same("repair", "the pin of board 2", played.boards[1].status & OPINIT, OPINIT)
                bench.same("repair", "flash number", said["board"]["flash_number"], flash[1])
    bench.ok("repair")


def dbc(bench: Bench) -> None:
    """P-21: cantools reads the exported file, and decodes recorded frames as the tool does."""
    with bench.chain("--boards", "1") as chain, chain.peer() as peer:
        for words in (("init", "--renew"), ("start", "1"), ("dbc", "1", "--out", chain.path("chain.dbc"))):
            told(bench, "P-21", chain.start(*words), 0)
        database = cantools.database.load_file(chain.path("chain.dbc"))
        value = f"set_position={bench.random.randint(-3000, 3000)}"
        told(bench, "P-21", chain.start("ci", "1", value, "--for", "1.0"), 0)
        frames = peer.all(0.5)
        log = chain.write("bus.log", "".join(f"(0.0) can0 {frame}\n" for frame in frames))
        decode = chain.start("decode", log)
        told(bench, "P-21", decode, 0)
        ours = [json.loads(line) for _, line in decode.out]
        bench.same("P-21", "decoded frames", len(ours), len(frames))
        compared = 0
        for frame, line in zip(frames, ours, strict=True):
            if not frame.startswith("381#"):
                continue
            data = wire.parts(frame)[2]
            theirs = database.decode_message(0x381, data)
            offset = int(theirs.pop(next(key for key in theirs if "offset" in key.lower())))
            words = [int(value) for value in theirs.values()]
            table = [wire.number(bench.order, data[i:i + 2]) for i in range(0, 8, 2)]
            signed = [w - 0x10000 if w & 0x8000 else w for w in table[1:]][:len(words)]
            bench.same("P-21", f"{frame}: ours", (line["offset"], line["words"][:len(words)]), (offset, words))
            bench.same("P-21", f"{frame}: the table's", (table[0], signed), (offset, words))
            compared += 1
        bench.expect(compared > 50, "P-21", "more than 50 frames of outputs", compared)
        bench.ok("P-21", f"{compared} frames read alike")


if __name__ == "__main__":
    rows.main([init, acknowledgements, repair, scan, dbc])
