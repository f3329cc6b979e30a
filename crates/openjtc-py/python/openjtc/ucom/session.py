"""Session of a chain: opening and closing the chain, names of boards, and events."""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
import weakref
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from openjtc import _native
from openjtc._native import ChainRecording, SimulatedChain
from openjtc.errors import FaultError, UsageError
from openjtc.ucom.reports import BusState, Event

__all__ = ["Boards", "Recording", "Session"]

#: Selection of boards: a number, several numbers, names of an inventory, a list or range as text (``"1,4-6"``), or
#: ``"all"``.
Boards = int | str | Iterable[int | str]
_Path = str | os.PathLike[str]
_Self = TypeVar("_Self", bound="Session")


def _close(native: _native.Chain) -> None:
    """Closes a chain at the end of the program, or when the last reference to an open chain is deleted."""
    not_stopped = native.close()
    if not_stopped and sys.stderr is not None:
        # Exceptions are suppressed, because no caller could handle them at this point.
        with contextlib.suppress(OSError, ValueError):
            print(f"openjtc: {_not_stopped(not_stopped)}", file=sys.stderr, flush=True)


def _not_stopped(boards: Iterable[int]) -> str:
    listed = ", ".join(map(str, boards))
    return f"not stopped for certain: board {listed}; without heartbeats the boards become safe by themselves"


class Session:
    """Base class of every chain; see `openjtc.ucom.Chain`."""

    def __init__(self, native: _native.Chain, names: Mapping[str, int], simulated: SimulatedChain | None) -> None:
        self._native = native
        self._names = {name.lower(): number for name, number in names.items()}
        self._inventory_names: dict[str, int] = {}
        self._simulated = simulated
        self._finalizer = weakref.finalize(self, _close, native)

    @property
    def url(self) -> str:
        """URL of the bus; other programs can join the bus of a simulated chain."""
        return self._native.url

    @property
    def simulated(self) -> SimulatedChain | None:
        """Simulated chain that was passed to `connect` or that `connect` has made; None for a real chain."""
        return self._simulated

    def __enter__(self: _Self) -> _Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        not_stopped = self._end()
        if not_stopped:
            self._say_not_stopped(not_stopped, error is not None)
        if error is None:
            self.check()

    def close(self) -> None:
        """Stops everything that this chain has started, and releases the bus. The end of the context also stops everything, and then calls
        `check`.

        Raises:
            FaultError: Some boards may not be stopped (``not-stopped``). Without heartbeats, these boards become safe by themselves.
        """
        not_stopped = self._end()
        if not_stopped:
            self._say_not_stopped(not_stopped, False)

    def _end(self) -> list[int]:
        self._finalizer.detach()
        try:
            return list(self._native.close())
        except BaseException:
            # Ctrl-C has interrupted the wait. The thread of the session continues, and the end of the program waits
            # for it.
            self._finalizer = weakref.finalize(self, _close, self._native)
            raise

    def _say_not_stopped(self, boards: list[int], warn: bool) -> None:
        text = _not_stopped(boards)
        if warn:
            warnings.warn(text, RuntimeWarning, stacklevel=4)
            return
        board = boards[0] if len(boards) == 1 else None
        raise FaultError(text, "not-stopped", next=f"ucom stop {','.join(map(str, boards))}", board=board)

    def __repr__(self) -> str:
        return f"<openjtc.ucom.Chain {self.url}>"

    # Events of the chain, and errors.

    def check(self) -> None:
        """Raises an error if a board was lost, left its control loop by itself, or shares its number. Each event raises only one error.

        Iterating a `monitor`, calling `values`, reading an old output, and the end of the context also raise errors about boards.

        Raises:
            FaultError: ``lost``, ``left-loop`` or ``number-shared``, with ``.board``.
        """
        self._native.check()

    def events(self, after: int = 0) -> list[Event]:
        """Returns the last 4096 events on the bus, oldest first.

        Args:
            after: Returns only events with higher numbers.
        """
        return [Event(**event) for event in self._native.events(after)]

    def bus(self) -> BusState:
        """Returns load and frame counts of the bus."""
        return BusState(**self._native.bus())

    def record(self, path: _Path, *, overwrite: bool = False) -> Recording:
        """Records every frame of the bus, including the frames of this chain, until the end of the context or ``.end()``.

        Args:
            path: Path of the file: ``.log`` for the format of candump, ``.fzi`` for FZI-CAN, ``.mcap`` for MCAP. The profile is written
                into the file or into a file next to it.
            overwrite: Overwrites an existing file.
        """
        if not overwrite and Path(path).exists():
            raise UsageError(f"{os.fspath(path)} already exists", "exists", next="choose another file, or pass overwrite=True")
        return Recording(self._native.record(os.fspath(path)))

    # Names of boards.

    def _named(self, name: str) -> int | None:
        name = name.strip().lower()
        if name.isdecimal():
            return int(name)
        return self._names.get(name, self._inventory_names.get(name))

    def _number(self, board: int | str) -> int:
        number = self._named(board) if isinstance(board, str) else int(board)
        if number is None or not 0 <= number <= 31:
            raise UsageError(f"{board!r} is not a valid board: expected a number (0 to 31) or a name of the inventory", "usage")
        return number

    def _list(self, boards: Boards) -> str:
        if isinstance(boards, str):
            if boards.strip().lower() in ("all", "none"):
                return boards.strip().lower()
            number = self._named(boards)
            return boards if number is None else str(number)
        if isinstance(boards, Iterable):
            return ",".join(str(self._number(board)) for board in boards) or "none"
        return str(self._number(boards))


class Recording:
    """A recording in progress. Used as a context manager, it ends the recording when the block ends."""

    def __init__(self, native: ChainRecording) -> None:
        self._native = native
        #: Number of written frames. The next attribute is the number of omitted frames, whose protocol the format
        #: cannot store. The chain sets both numbers of frames at the end of the recording.
        self.frames = 0
        self.left_out = 0

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Ends the recording.

        Raises:
            FaultError: The recording could not be written completely (``recording``).
        """
        counts = self._native.end()
        if counts is not None:
            self.frames, self.left_out = counts
