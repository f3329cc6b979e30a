"""Runs the rows of the protocol's tests in parallel, each in its own process and on its own bus.

A row that fails while others run is repeated once alone. The second result is the valid one; both are printed.

A row is a function of a `Bench`; it runs once for each byte order of words. Random values depend on a seed that is printed; `--seed N`
gives the same values again. `--only TEXT` runs the rows whose function name contains that text.
"""

import argparse
import concurrent.futures
import multiprocessing
import random
import threading
import time
import traceback

from peer import Chain

# Times of the protocol have a tolerance of a fifth.
BENCH = 1.2
# Wake-up delay in seconds above which a computer is too slow to check answers within 100 ms.
TOO_LATE = 0.05
TRIES = 3


class Disagreement(Exception):
    """The result differs from the expected one."""


class Jitter(threading.Thread):
    """Measures how late this computer wakes threads that sleep for 5 ms. No program on it can be more punctual."""

    def __init__(self):
        super().__init__(daemon=True)
        self.late: list[tuple[float, float]] = []
        self.ending = False

    def run(self) -> None:
        while not self.ending:
            due = time.monotonic() + 0.005
            time.sleep(0.005)
            late = time.monotonic() - due
            if late > 0.002:
                self.late.append((time.time(), late))

    def worst(self, since: float, until: float) -> float:
        """Returns the longest delay, in seconds, that ended between two times."""
        return max((late for at, late in list(self.late) if since <= at <= until + late), default=0.0)


class Bench:
    """Environment of a row."""

    def __init__(self, program: str, order: str, seed: int, name: str):
        self.program, self.order = program, order
        self.random = random.Random(f"{seed} {name} {order}")
        self.seed = seed
        self.lines: list[str] = []
        self.jitter = Jitter()
        self.jitter.start()

    def chain(self, *options: str, profile: str = "") -> Chain:
        return Chain(self.program, "--seed", str(self.seed), *options, order=self.order, profile=profile)

    def bus(self, profile: str = "") -> Chain:
        """Starts a bus without boards."""
        return self.chain("--boards", "0", profile=profile)

    def ok(self, rule: str, note: str = "") -> None:
        """Records that a rule holds."""
        self.lines.append(f"{rule} {self.order}-endian ok{': ' if note else ''}{note}")

    def expect(self, holds: bool, rule: str, expected: str, came) -> None:
        if not holds:
            raise Disagreement(f"{rule} {self.order}-endian FAIL: expected {expected}; came {came}")

    def same(self, rule: str, what: str, came, expected) -> None:
        self.expect(came == expected, rule, f"{what} {expected}", came)

    def within(self, rule: str, what: str, seconds: float, low: float, high: float) -> None:
        """Checks that a time is between two others, all in seconds."""
        self.expect(low <= seconds <= high, rule, f"{what} after {low:.3f} to {high:.3f} s", f"{seconds:.3f} s")

    def image(self, least: int = 200, most: int = 1200) -> bytes:
        """Returns an image of whole words."""
        return self.random.randbytes(2 * self.random.randint(least // 2, most // 2))

    def flash_ids(self, count: int) -> list[int]:
        """Returns flash numbers that differ in their low seven bits."""
        return [self.random.randrange(256) << 8 | low for low in self.random.sample(range(1, 128), count)]


def run_row(program: str, order: str, seed: int, function) -> tuple[bool, list[str], float]:
    """Runs one row. Returns whether its rules hold, and the lines to print.

    Answers within 100 ms are possible only if the computer runs its programs within 100 ms. A row that failed on a slow computer is run
    again, three times in all.
    """
    start, lines = time.monotonic(), []
    for tries in range(TRIES):
        began = time.time()
        bench = Bench(program, order, seed, function.__name__)
        failure = None
        try:
            function(bench)
        except Disagreement as e:
            failure = str(e)
        except Exception:
            failure = f"{function.__name__} {order}-endian FAIL: {traceback.format_exc()}"
        bench.jitter.ending = True
        late = bench.jitter.worst(began, time.time())
        lines += bench.lines if failure is None else [*bench.lines, failure]
        if failure is None or late < TOO_LATE or tries == TRIES - 1:
            break
        lines.append(f"this machine was {late * 1e3:.0f} ms late itself: once more")
    return failure is None, lines, time.monotonic() - start


def main(rows: list, workers: int = 12) -> None:
    """Runs the rows of a script. The arguments are the `ucom` program and the options above. Exit code 0: all hold."""
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    print(f"seed {arguments.seed}", flush=True)
    start, failed = time.monotonic(), []
    spawn = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(workers, mp_context=spawn) as pool:
        jobs = [
            (row, order, pool.submit(run_row, arguments.program, order, arguments.seed, row))
            for row in rows if arguments.only in row.__name__ for order in ("little", "big")
        ]
        for row, order, job in jobs:
            if not told(row, order, job.result()):
                failed.append((row, order))
    held = True
    for row, order in failed:
        print(f"{row.__name__}, {order}-endian: once more, alone", flush=True)
        held &= told(row, order, run_row(arguments.program, order, arguments.seed, row))
    print(f"{time.monotonic() - start:.0f} s in all")
    raise SystemExit(0 if held else 1)


def told(row, order: str, came: tuple[bool, list[str], float]) -> bool:
    """Prints the result of a row, and returns whether its rules hold."""
    good, lines, seconds = came
    for line in lines:
        print(line, flush=True)
    print(f"  {row.__name__}, {order}-endian: {seconds:.0f} s", flush=True)
    return good
