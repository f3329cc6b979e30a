"""Checks boards that `ucom` describes, runs and supervises; this script plays them on python-can's socketcand interface.

Argument: the `ucom` program. Exit code 0: all agreed.
"""

import itertools
import json
import re
import threading
import time

import rows
import wire
from check_pc_update import punctual
from pc_board import EXLRUN, INIT, MCARUN, MSTART, OPINIT
from pc_play import PATIENT, boards, intrusive, told
from peer import Peer
from rows import Bench

SAFE = "600#00000000"


class Traffic(threading.Thread):
    """Sends outputs of ten boards at full rate: two packages of each board every 10 ms."""

    def __init__(self, peer: Peer, order: str, numbers: range):
        super().__init__(daemon=True)
        self.peer, self.order, self.numbers = peer, order, numbers
        self.sent = 0
        self.ending = threading.Event()

    def run(self) -> None:
        due = time.monotonic()
        for turn in itertools.count():
            for number in self.numbers:
                buffer = [number << 8 | (turn + i) & 0xFF for i in range(6)]
                for package in wire.packages(self.order, buffer):
                    self.peer.send(wire.frame(14, number, package))
                    self.sent += 1
            due = max(due + 0.01, time.monotonic() - 0.05)
            if self.ending.wait(max(0.0, due - time.monotonic())):
                return


def interleaved(bench: Bench) -> None:
    """P-6: outputs of ten boards and DSP_INFO of board 3 arrive between the frames of a dump of board 2."""
    flash = bench.flash_ids(13)
    order = bench.order
    head = wire.word(order, flash[2]) + bytes([3, MSTART | INIT]) + wire.word(order, 1) + wire.word(order, 2)
    info = itertools.cycle([head, *wire.string(order, "somebody else's description")])

    def others() -> list[str]:
        return [wire.frame(5, 3, next(info)) for _ in range(bench.random.randint(1, 4))]

    how = {"numbered": True, "running": 13, "shape": (4, 6, 5), "between": others, "dump_gap": 0.012}
    with bench.bus(PATIENT) as chain, chain.peer() as peer, boards(bench, chain, flash, **how) as played:
        traffic = Traffic(peer, order, range(4, 14))
        traffic.start()
        began = time.time()
        (said,) = told(bench, "P-6", chain.start("io", "2", "--fresh"), 0)["boards"]
        sent, seconds = traffic.sent, time.time() - began
        board = played.boards[1]
        came = [said["description"], *said["ci"], *said["so"], *said["par"]]
        bench.same("P-6", "names of board 2", came, board.names())
        bench.same("P-6", "dimensions of board 2", tuple(len(said[kind]) for kind in ("ci", "so", "par")), board.shape)
        bench.same("P-6", "initial inputs of board 2", said["initial_ci"], board.initial())
        bench.same("P-6", "requests of the dump", len(played.frames("582#")), 1)
        played.quirks.between = list
        (said,) = told(bench, "P-6", chain.start("info", "3"), 0)["boards"]
        third = (flash[2], played.boards[2].names()[0])
        bench.same("P-6", "board 3", (said["flash_number"], said["description"]), third)
        number = bench.random.randint(4, 13)
        so = chain.start("so", str(number), "--count", "20")
        told(bench, "P-6", so, 0)
        for line in (json.loads(line) for _, line in so.out):
            words = list(line["so"].values())
            first = words[0] & 0xFF if words else 0
            expected = [number << 8 | (first + i) & 0xFF for i in range(6)]
            bench.same("P-6", "board and its outputs", (line["board"], words), (number, expected))
        traffic.ending.set()
        traffic.join()
        bench.ok("P-6", f"{sent / seconds:.0f} frames/s of ten boards during the dump")


def dump_and_life_signs(bench: Bench) -> None:
    """P-14: heartbeats continue during a dump of some seconds."""
    how = {"numbered": True, "dump_gap": 0.07, "shape": (4, 6, 5)}
    with bench.bus(PATIENT) as chain, boards(bench, chain, bench.flash_ids(1), **how) as played:
        command = chain.start("run", "1", "--for", "0.5")
        told(bench, "P-14", command, 0)
        first = played.times("581#")[0]
        last = max(at for at, frame in played.said if frame.startswith("581#"))
        bench.expect(last - first > 2.5, "P-14", "a dump of some seconds", f"{last - first:.1f} s")
        punctual(bench, "dump", [at for at in played.times("680#") if at <= last], first, last)


def lost_and_back(bench: Bench) -> None:
    """P-15: a board is silent for 6 s."""
    with bench.bus(PATIENT) as chain, boards(bench, chain, bench.flash_ids(2), numbered=True) as played:
        command = chain.start("run", "1,2", "--for", "11", "--active")
        bench.expect(command.wait_out("running") is not None, "P-15", "both boards run", command.notes)
        time.sleep(bench.random.uniform(1.2, 1.8))
        board = played.boards[1]
        board.silent = True
        lost = command.wait_note("board 2: lost", 8.0)
        bench.expect(lost is not None, "P-15", "an event", command.notes)
        last = max(at for at, frame in played.said if frame == "682#")
        late = bench.jitter.worst(last, lost)
        bench.within("P-15", "the event", lost - last, 3.0 / rows.BENCH, 3.1 * rows.BENCH + late)
        time.sleep(0.5)
        stops = played.times(SAFE)
        limit = 0.1 * rows.BENCH + bench.jitter.worst(lost - 0.5, lost + 0.5)
        bench.expect(stops != [], "P-15", SAFE, played.frames("6"))
        bench.within("P-15", SAFE, stops[0] - lost, -limit, limit)
        bench.expect(not played.boards[0].status & MCARUN, "P-15", "board 1 stopped, too", played.boards[0].status)
        after = [frame for at, frame in list(played.heard) if at > stops[0] + limit and frame.startswith("34")]
        bench.same("P-15", "inputs after the stop", after, [])
        board.silent = False
        back = command.wait_note("board 2: back", 3.0)
        bench.expect(back is not None, "P-15", "back", command.notes)
        told(bench, "P-15", command, 5)
        after = f"{1e3 * (stops[0] - lost):+.0f} ms"
        bench.ok("P-15", f"lost after {lost - last:.2f} s, {SAFE} {after} from the event, {len(stops)} times")


def rebooted(bench: Bench) -> None:
    """P-16: a board sends a report without a request."""
    with bench.bus(PATIENT) as chain, boards(bench, chain, bench.flash_ids(2), numbered=True) as played:
        command = chain.start("run", "1,2", "--for", "4")
        bench.expect(command.wait_out("running") is not None, "P-16", "both boards run", command.notes)
        time.sleep(1.3)
        played.later(0.0, played.crash, played.boards[1])
        said = command.wait_note("has rebooted", 3.0)
        bench.expect(said is not None, "P-16", "rebooted", command.notes)
        bench.expect(command.note("board 2 (") == said, "P-16", "the board's number", command.notes)
        command.end()
        bench.ok("P-16", next(line for at, line in command.notes if at == said))


def second_master(bench: Bench) -> None:
    """P-17: frames that only a PC sends arrive every 100 ms."""
    image = bench.image()
    zeros = "0" * 16
    frames = ["680#", "205#", "240#", "585#", "600#00000000", f"345#{zeros}", f"2C5#{zeros}"]
    foreign = bench.random.sample(frames, 4)
    flash = bench.flash_ids(1)
    with bench.bus(PATIENT) as chain, chain.peer() as other, boards(bench, chain, flash, numbered=True) as played:
        path = chain.write("image.bin", image)
        commands = [("start", "1"), ("update", "1", path), ("init", "--renew"), ("run", "1", "--for", "1")]
        for words, frame in zip(commands, foreign):
            # The other PC's last frame for the previous command may still be in transmission.
            time.sleep(0.2)
            del played.heard[:]
            command = chain.start(*words)
            while command.process.poll() is None:
                other.send(frame)
                time.sleep(0.1)
            told(bench, "P-17", command, 4)
            # The frames of the other PC are received here as well.
            odd = [f for f in intrusive(played.frames()) if f != frame]
            bench.same("P-17", f"{words[0]}: frames that do something", odd, [])
        # The tool does not mistake heartbeats and flags of a running board for frames of a PC.
        command = chain.start("start", "1")
        while command.process.poll() is None:
            other.send("682#")
            other.send("602#01010000")
            time.sleep(0.1)
        told(bench, "P-17", command, 0)
        bench.expect("301#" in played.frames(), "P-17", "a start beside a running board", played.frames())
        bench.ok("P-17", " ".join(foreign))


def load(bench: Bench) -> None:
    """P-19: a bus cannot carry the data of sixteen boards with twelve outputs and three inputs each."""
    shape = (3, 12, 0)
    how = {"numbered": True, "shape": shape, "running": 16}
    with bench.bus(PATIENT) as chain, boards(bench, chain, bench.flash_ids(16), **how) as played:
        command = chain.start("run", "1-16", "--for", "1")
        said = told(bench, "P-19", command, 4)
        # Smallest number of boards that is too large. A package has 135 bits; outputs are sent every 10 ms, inputs every 20 ms.
        forecast, count = map(int, re.search(r"(\d+) %.* (\d+) boards", said["error"]["message"]).groups())
        percent = count * (4 * 100 + 1 * 50) * 135 / 1e6 * 100
        bench.expect(count <= 16 and 70 < forecast, "P-19", "a forecast of more than 70 %", said)
        bench.expect(abs(forecast - percent) < 1.5, "P-19", f"{percent:.0f} % with {count} boards", said)
        acts = {frame for frame in intrusive(played.frames()) if frame != "680#"}
        bench.same("P-19", "frames that do something:", acts, set())
        told(bench, "P-19", chain.start("run", "1-3", "--for", "0.3"), 0)
        bench.same("P-19", "three of them run:", len({f for f in played.frames("54") if f.endswith("#")}), 3)
    bench.ok("P-19", f"{forecast} % with {count} boards")


def wait_for_stop(bench: Bench) -> None:
    """Checks the state after `ucom run`: outputs off, control off, applications stopped, in reverse order."""
    with bench.bus(PATIENT) as chain, boards(bench, chain, bench.flash_ids(2), numbered=True) as played:
        told(bench, "stop", chain.start("run", "1,2", "--for", "0.5", "--active"), 0)
        left = [board.status for board in played.boards]
        bench.same("stop", "status of both boards", left, [EXLRUN | INIT | OPINIT] * 2)
        order = [frame[2] for frame in played.frames("601#00", "602#00", "1C1#80", "1C2#80")]
        bench.expect(order[:1] == ["2"], "stop", "the last board first", played.frames("60", "1C"))
    bench.ok("stop")


if __name__ == "__main__":
    rows.main([lost_and_back, interleaved, dump_and_life_signs, rebooted, second_master, load, wait_for_stop])
