"""Runs a `ucom` command with boards that a script plays."""

from collections.abc import Iterator
from contextlib import contextmanager

from pc_board import Quirks
from pc_boards import Boards
from peer import Chain, Command
from rows import Bench

# Longer timeouts for rows that do not test them, because this script's boards answer late on a busy computer.
PATIENT = "string.gap = 400\ninfo.timeout = 400\nadmin.timeout = 400\n"
# Functions that are only questions; all other functions of a PC change boards.
HARMLESS = (8, 9, 22, 23)


@contextmanager
def boards(bench: Bench, chain: Chain, flash: list[int], **how) -> Iterator[Boards]:
    """Runs boards on a bus. The keyword arguments are fields of `Quirks`, and shape, numbered, running of `Boards`."""
    fixed = {key: how.pop(key) for key in ("shape", "numbered", "running") if key in how}
    with chain.peer() as peer, Boards(peer, flash, Quirks(bench.order, **how), **fixed) as played:
        yield played


def told(bench: Bench, rule: str, command: Command, code: int | tuple[int, ...], seconds: float = 120.0) -> dict:
    """Waits for the command's end, which must have one of these exit codes. Returns its output."""
    codes = (code,) if isinstance(code, int) else code
    came = command.end(seconds)
    notes = [line for _, line in command.notes]
    bench.expect(came in codes, rule, f"exit code {code}", f"{came}: {command.out[-1:]} {notes[-5:]}")
    return command.said()


def intrusive(frames: list[str]) -> list[str]:
    """Returns the frames of a PC that change boards."""
    return [frame for frame in frames if int(frame[:3], 16) >> 6 not in HARMLESS]
