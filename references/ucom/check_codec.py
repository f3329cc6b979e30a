"""Checks frames, strings and buffers that `ucom` reads and writes against this script's own tables, over python-can.

Argument: the `ucom` program. Exit code 0: all agreed.
"""

import json
import signal
import time

import can

import rows
import wire
from boards_bench import five, give_numbers, start
from pc_play import PATIENT, boards, told
from rows import Bench

# Function names in the order of their numbers.
NAMES = """
PC_RESET PC_XRESET DSP_ERROR DSP_INITACK DSP_PROGFINISHED DSP_INFO DSP_READY PC_SETSTATUS PC_INFO PC_REPORT
PC_INIT PC_PROG PC_START MCA_PC_CI MCA_DSP_SO MCA_PC_PAR DSP_REPORT0 DSP_REPORT1 DSP_REPORT2 DSP_REPORT3
MCA_DSP_READY MCA_PC_START MCA_DUMP_IO_DESCRIPTION MCA_DUMP_CI MCA_ADMIN_DATA MCA_DEBUG_MSG MCA_ALIVE
MCA_DSP_CI
""".split()


def identifiers(bench: Bench) -> None:
    frames = [(f, n, wire.frame(f, n)) for f in range(28) for n in range(32)]
    with bench.bus() as chain:
        decode = chain.start("decode", chain.write("all.log", "".join(f"(0.0) can0 {frame}\n" for *_, frame in frames)))
        told(bench, "C-1", decode, 0)
        for (function, _, frame), (_, line) in zip(frames, decode.out, strict=True):
            bench.same("C-1", f"function of {frame}", json.loads(line)["function"], NAMES[function])
        told(bench, "C-1", chain.start("info", "32"), 2)
    bench.ok("C-1", f"{len(frames)} identifiers")


def foreign(bench: Bench) -> None:
    """C-2: foreign frames are counted and shown, and have no effect."""
    messages = [can.Message(arbitration_id=i, is_extended_id=True) for i in (0, 0x201, 0x1FFFFFFF)]
    messages += [can.Message(arbitration_id=0x201 | 0x20, is_extended_id=False)]
    messages += [can.Message(arbitration_id=f << 6 | 1, is_extended_id=False) for f in range(28, 32)]
    with five(bench) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 2)
        monitor = chain.start("monitor", "--listen-only", "--count", "2")
        time.sleep(0.8)
        for message in messages:
            peer.bus.send(message)
        bench.same("C-2", "answers", peer.all(0.3), [])
        said = told(bench, "C-2", monitor, 0)
        bench.same("C-2", "foreign frames", said["foreign_frames"], len(messages))
        bench.same("C-6", "surplus bytes are ignored:", peer.answer("201#0000000000000000", "141#")[:4], "141#")
        peer.all(0.1)
        bench.same("C-6", "a message that is too short:", peer.ask("1C1#02", 0.2), ["081#07"])
    bench.ok("C-2")
    bench.ok("C-6")


def recorded(bench: Bench) -> None:
    """C-3 and C-7: a recording contains the frames that were sent, and a replay sends them again. `000#` is a frame like all others."""
    for ending in ("log", "fzi"):
        sent = ["000#"] + [
            wire.frame(bench.random.randrange(28), bench.random.randrange(32), bench.random.randbytes(length))
            for length in [*range(9)] * 3
        ]
        with bench.bus() as chain, chain.peer() as peer:
            path = chain.path(f"bus.{ending}")
            record = chain.start("record", path)
            time.sleep(1.0)
            for frame in sent:
                peer.send(frame)
            time.sleep(0.5)
            record.process.send_signal(signal.SIGINT)
            said = told(bench, "C-7", record, 0)
            bench.same("C-7", "recorded frames", said["frames"], len(sent))
            decode = chain.start("decode", path)
            told(bench, "C-3", decode, 0)
            lines = [json.loads(line) for _, line in decode.out]
            bench.same("C-3", "000#", (lines[0]["function"], lines[0]["who"]), ("PC_RESET", "PC > all"))
            bench.same("C-7", f"frames of the {ending} file", [line["frame"] for line in lines], sent)
            told(bench, "C-7", chain.start("replay", path, "--intrusive", "--force"), 0)
            bench.same("C-7", f"replay of the {ending} file", peer.all(0.5), sent)
    bench.ok("C-3")
    bench.ok("C-7")


def strings(bench: Bench) -> None:
    letters = [chr(code) for code in (*range(32, 127), 0xE4)]
    texts = ["".join(bench.random.choices(letters, k=n)) for n in (0, 1, 7, 8, 9, 16, 512)]
    sent = [*texts, "\xe4\xf6", "zeros\0\0\0"]
    with bench.bus(PATIENT) as chain, boards(bench, chain, bench.flash_ids(len(sent)), numbered=True) as played:
        for board, text in zip(played.boards, sent, strict=True):
            board.text = text
        said = told(bench, "C-4", chain.start("info", f"1-{len(sent)}"), 0)
        came = [board["description"] for board in said["boards"]]
        bench.same("C-4", "texts", came, [text.rstrip("\0") for text in sent])
    bench.ok("C-4", "0, 1, 7, 8, 9, 16, 512 characters, Latin-1, NULs at the end")


def buffers(bench: Bench) -> None:
    for dimension in (0, 1, 2, 3, 4, 6, 7):
        how = {"numbered": True, "running": 1, "shape": (dimension, 1, 0)}
        with bench.bus(PATIENT) as chain, boards(bench, chain, bench.flash_ids(1), **how) as played:
            (said,) = told(bench, "C-5", chain.start("io", "1"), 0)["boards"]
            bench.same("C-5", f"{dimension} inputs:", said["initial_ci"], played.boards[0].initial())
    with five(bench) as chain, chain.peer() as peer:
        start(bench, peer)
        for offset in (3, 0xFFFD, 0xFFFF):
            late = wire.frame(13, 1, wire.package(bench.order, offset, 1, 2, 3))
            bench.same("C-5", f"index {offset} of 3 inputs:", peer.answer(late, "081"), "081#05")
    bench.ok("C-5")


if __name__ == "__main__":
    rows.main([buffers, recorded, foreign, strings, identifiers])
