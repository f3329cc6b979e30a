"""Checks `ucom update` with boards that this script plays on python-can's socketcand interface.

Argument: the `ucom` program. Exit code 0: all agreed.
"""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager

import rows
import wire
from pc_boards import Boards
from pc_play import PATIENT, boards, intrusive, told
from peer import Chain, Command
from rows import Bench

# 2009-06-01.
DATE = 0x3AC1


@contextmanager
def alone(bench: Bench, profile: str = "", **quirks) -> Iterator[tuple[Chain, Boards]]:
    """Runs a bus with one numbered board. The keyword arguments are fields of `Quirks`."""
    with bench.bus(PATIENT + profile) as chain, boards(bench, chain, [0x21], numbered=True, **quirks) as played:
        yield chain, played


def begin(chain: Chain, image: bytes, *words: str) -> Command:
    return chain.start("update", "1", chain.write("image.bin", image), "--date", "2009-06-01", *words)


def blocks(image: bytes) -> int:
    """Returns the number of blocks of a cycle, including the header's."""
    return 1 + len(wire.padded(image))


def verified(bench: Bench, rule: str, played: Boards, command: Command, image: bytes, attempts: int = 1) -> None:
    """Checks that the update is done as required."""
    said = told(bench, rule, command, 0)
    bench.same(rule, "outcome", said["outcome"], "verified")
    bench.same(rule, "attempts told", said["boards"][0]["attempts"], attempts)
    bench.same(rule, "PC_XRESET", played.attempts, attempts)
    bench.same(rule, "program on the board", played.boards[0].program, (wire.crc16(image), DATE))
    bench.same(rule, "what is wrong with the transfer", (played.complaints, played.early), ([], []))


def golden(bench: Bench) -> None:
    image = bytes((37 * i + 11) % 256 for i in range(1000))
    for words in ((), ("--flash-id", "0x21")):
        with alone(bench) as (chain, played):
            verified(bench, "13.4", played, begin(chain, image, *words), image)
            frames = played.frames("2C1")
            cycles = [wire.header(bench.order, n, image, DATE) + b"".join(wire.padded(image)) for n in (1, 2)]
            data = b"".join(cycles)
            for i, frame in enumerate(frames):
                bench.same("13.4", f"program frame {i}:", frame, wire.frame(11, 1, data[8 * i:8 * i + 8]))
            bench.same("13.4", "program frames", len(frames), 2 * 136)
            if bench.order == "little" and not words:
                header = "4355010001000000 00000000F4010000 3F4BC13AFFFFFFFF".split() + ["F" * 16] * 4
                named = [f"2C1#{part}" for part in (*header, "FFFFFFFFFFFFDC22", "0B30557A9FC4E90E")]
                bench.same("13.4", "first frames", frames[:9], named)
            # D-62: no inventory has a record of this board, so its Program ID and date do not prove the image.
            said = told(bench, "U-3", begin(chain, image), 4)
            bench.same("U-3", "outcome of the same image again", (said["outcome"], played.attempts), ("program-up-to-date", 1))
            said = told(bench, "U-3", begin(chain, image, "--unverified"), 0)
            bench.same("U-3", "outcome", said["outcome"], "program-up-to-date")
    bench.ok("13.4")


def other_board(bench: Bench) -> None:
    image = bench.image()
    for quirk, words in (({}, ("--flash-id", "0x42")), ({"other_number": True}, ())):
        with alone(bench, **quirk) as (chain, played):
            told(bench, "P-5", begin(chain, image, *words), (1, 3, 4) if quirk else 4)
            bench.same("P-5", "frames that do something", intrusive(played.end()), [])
    bench.ok("P-5")


def one_by_one(bench: Bench) -> None:
    """P-7: DSP_READY comes after any delay, and no frame of the next block comes before it."""
    image = bench.image()
    with alone(bench, late_by=lambda: bench.random.uniform(0, 0.06)) as (chain, played):
        verified(bench, "P-7", played, begin(chain, image), image)
        bench.same("P-7", "program frames", len(played.frames("2C1")), 2 * 8 * blocks(image))
    bench.ok("P-7", f"{2 * blocks(image)} blocks")


def late_ready(bench: Bench) -> None:
    """P-8: the board needs 0.9 s for a block, and 8 s each for the erase and the end."""
    image = bench.image(200, 400)
    middle = bench.random.randint(1, blocks(image) - 2)
    late = {(1, 0): 0.9, (1, middle): 0.9, (2, 0): 8.0, (2, middle): 0.9, (2, blocks(image) - 1): 8.0}
    with alone(bench, late=late) as (chain, played):
        verified(bench, "P-8", played, begin(chain, image), image)
    bench.ok("P-8", f"{sorted(late.items())}")


def end_lost(bench: Bench) -> None:
    image = bench.image()
    with alone(bench, lost_finished=True) as (chain, played):
        verified(bench, "P-9", played, begin(chain, image), image)
    bench.ok("P-9")


def old_program(bench: Bench) -> None:
    image = bench.image()
    with alone(bench, keeps_old=True) as (chain, played):
        said = told(bench, "P-10", begin(chain, image), 5)
        bench.expect(said["outcome"] not in ("verified", "running"), "P-10", "a failure", said)
        bench.same("P-10", "program", played.boards[0].program, (0x1234, 0x386E))
    bench.ok("P-10")


def errors(bench: Bench) -> None:
    image = bench.image()
    last = blocks(image) - 1
    # Each entry: error code, cycle, block, attempts, exit code.
    cases = [(2, 1, 0, 1, 1), (5, 1, 0, 1, 1), (5, 2, 0, 1, 5), (2, 2, bench.random.randint(1, last), 1, 5),
             (1, 1, last, 3, 1), (1, 2, last, 3, 5)]
    for code, cycle, block, attempts, leave in cases:
        name = f"error {code} after block {block} of cycle {cycle}:"
        with alone(bench, errors={(cycle, block): code}) as (chain, played):
            said = told(bench, "P-11", begin(chain, image), leave)
            frames = played.end()
            bench.same("P-11", f"{name} attempts", frames.count("041#"), attempts)
            per_attempt = 8 * ((cycle - 1) * blocks(image) + block + 1)
            data = [frame for frame in frames if frame.startswith("2C1")]
            bench.same("P-11", f"{name} frames", len(data), attempts * per_attempt)
            bench.same("P-11", f"{name} attempts told", said["boards"][0]["attempts"], attempts)
    bench.ok("P-11", "errors 2 and 5 once, 1 three times")
    with alone(bench, errors={(1, last): 0x2A}) as (chain, played):
        said = told(bench, "P-18", begin(chain, image), (1, 5))
        told_so = str(said["boards"])
        bench.expect("42" in told_so or "2A" in told_so, "P-18", "the number of the error", said)
        bench.same("P-18", "attempts", played.attempts, 3)
    bench.ok("P-18")


def until(played: Boards, frames: int) -> int:
    """Waits until at least `frames` frames of program data were received; returns their number."""
    end = time.monotonic() + 30
    while (heard := len(played.frames("2C1"))) < frames:
        assert time.monotonic() < end, f"{heard} of {frames} frames"
        time.sleep(0.002)
    return heard


def cancelled(bench: Bench) -> None:
    image = bench.image()
    for cycle in (1, 2):
        # The PC sends slowly, so the signal comes during a block.
        with alone(bench, profile="prog.frame_gap_us = 20000\n") as (chain, played):
            command = begin(chain, image)
            until(played, 8 * ((cycle - 1) * blocks(image) + 2) + bench.random.randint(1, 6))
            command.process.send_signal(signal.SIGINT)
            said = told(bench, "P-12", command, 5 if cycle == 2 else 4, seconds=20)
            bench.same("P-12", "error told", said["boards"][0]["error"]["code"], "cancelled")
            time.sleep(0.1)
            frames = played.frames("2C1", "1C1")
            bench.same("P-12", "the last frame", frames[-1], "1C1#0400")
            bench.same("P-12", "PROG", played.boards[0].status & 4, 0)
            intact = played.boards[0].program == (0x1234, 0x386E)
            bench.same("P-12", f"cycle {cycle}: the old application is there:", intact, cycle == 1)
            played.attempts = 0
            verified(bench, "P-12", played, begin(chain, image), image)
    bench.ok("P-12", f"{len(frames[:-1]) % 8} frames of a block were sent")


def killed(bench: Bench) -> None:
    image = bench.image()
    for cycle in (1, 2):
        with alone(bench, profile="prog.frame_gap_us = 3000\n") as (chain, played):
            command = begin(chain, image)
            least = (cycle - 1) * blocks(image) + 1
            block = bench.random.randint(least, least + blocks(image) - 2)
            heard = until(played, 8 * block + bench.random.randint(1, 7))
            command.process.kill()
            bench.same("P-13", "exit code", command.end(), -9)
            played.complaints.clear()
            played.attempts = 0
            verified(bench, "P-13", played, begin(chain, image), image)
            bench.ok("P-13", f"killed in cycle {cycle}, after {heard} frames")


def group(bench: Bench) -> None:
    """Checks a broadcast to boards 1 and 3, each with its own delay of DSP_READY. Board 2 receives all frames and sends none."""
    image = bench.image()
    plans = {"": {}, "board 3 complains once": {(1, bench.random.randint(1, blocks(image) - 1)): 1}}
    for name, once in plans.items():
        with bench.bus(PATIENT) as chain, boards(
            bench, chain, bench.flash_ids(3), late_by=lambda: bench.random.uniform(0, 0.03)
        ) as played:
            told(bench, "group", chain.start("init", "--renew"), 0)
            played.boards[2].once = dict(once)
            path = chain.write("image.bin", image)
            said = told(bench, "group", chain.start("update", "1,3", path, "--date", "2009-06-01", "--group"), 0)
            results = [(b["board"], b["outcome"], b["attempts"]) for b in said["boards"]]
            bench.same("group", "results", results, [(1, "verified", 1), (3, "verified", 2 if once else 1)])
            new = (wire.crc16(image), DATE)
            programs = [board.program for board in played.boards]
            bench.same("group", "programs", programs, [new, (0x1234, 0x386E), new])
            bench.same("group", "too early, or wrong", (played.early, played.complaints), ([], []))
            bench.same("group", "frames to all", len(played.frames("2C0")), 2 * 8 * blocks(image))
            alone = len(played.frames("2C1", "2C2")), len(played.frames("2C3"))
            bench.same("group", "frames to one", alone, (0, 2 * 8 * blocks(image) if once else 0))
            silent = [frame for _, frame in played.said if frame.startswith(("082", "102", "182"))]
            bench.same("group", "of board 2", silent, [])
        bench.ok("group", name)


def life_signs(bench: Bench) -> None:
    """P-14: a heartbeat every 500 ms during an update of some seconds."""
    image = bench.image(1000, 1200)
    with alone(bench, late_by=lambda: 0.12) as (chain, played):
        verified(bench, "P-14", played, begin(chain, image), image)
        first, last = played.times("041#")[0], played.times("2C1")[-1]
        punctual(bench, "update", [at for at in played.times("680#") if at <= last], first, last)


def punctual(bench: Bench, what: str, signs: list[float], first: float, last: float) -> None:
    """Checks that a PC's heartbeats between two times are 500 ms apart. The average may differ by 50 ms, each pause by the bench's
    tolerance."""
    gaps = [after - before for before, after in zip(signs, signs[1:])]
    bench.expect(len(gaps) >= 4 and signs[0] <= first + 0.6, "P-14", f"heartbeats all the time of the {what}", signs)
    late = bench.jitter.worst(signs[0], last)
    mean = sum(gaps) / len(gaps)
    bench.expect(0.45 <= mean <= 0.55, "P-14", f"500 ms in the mean while the {what} goes on", f"{mean * 1e3:.0f} ms")
    span = (0.45 / rows.BENCH - late, 0.55 * rows.BENCH + late)
    bench.expect(
        all(span[0] <= gap <= span[1] for gap in gaps) and last - signs[-1] <= span[1],
        "P-14", f"{span[0] * 1e3:.0f} to {span[1] * 1e3:.0f} ms while the {what} goes on", [round(g, 3) for g in gaps],
    )
    bench.ok("P-14", f"{what}: {len(signs)} heartbeats, {min(gaps) * 1e3:.0f} to {max(gaps) * 1e3:.0f} ms apart")


if __name__ == "__main__":
    rows.main([late_ready, errors, end_lost, cancelled, killed, group, life_signs, golden, other_board, one_by_one,
               old_program])
