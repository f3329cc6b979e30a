"""The session of a chain: from its beginning to its end, the names of its boards, what has happened."""

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

#: Which boards: a number, several, names of an inventory, a list or range as text (``"1,4-6"``), or ``"all"``.
Boards = int | str | Iterable[int | str]
_Path = str | os.PathLike[str]
_Self = TypeVar("_Self", bound="Session")


def _close(native: _native.Chain) -> None:
    """At the end of the program, or of the last reference to a chain that was not closed."""
    not_stopped = native.close()
    if not_stopped and sys.stderr is not None:
        # Nobody takes an exception any more.
        with contextlib.suppress(OSError, ValueError):
            print(f"openjtc: {_not_stopped(not_stopped)}", file=sys.stderr, flush=True)


def _not_stopped(boards: Iterable[int]) -> str:
    listed = ", ".join(map(str, boards))
    return f"not stopped for certain: board {listed}; without heartbeats they become safe by themselves"


class Session:
    """What every chain has; see `openjtc.ucom.Chain`."""

    def __init__(self, native: _native.Chain, names: Mapping[str, int], simulated: SimulatedChain | None) -> None:
        self._native = native
        self._names = {name.lower(): number for name, number in names.items()}
        self._inventory_names: dict[str, int] = {}
        self._simulated = simulated
        self._finalizer = weakref.finalize(self, _close, native)

    @property
    def url(self) -> str:
        """The URL of the bus; other programs can join the one of a simulated chain."""
        return self._native.url

    @property
    def simulated(self) -> SimulatedChain | None:
        """The simulated chain, where `connect` was given one or has made one."""
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
        """Stops what this chain has started, and lets the bus go. The context manager does the same, then `check`.

        Raises:
            FaultError: Boards are not stopped for certain (``not-stopped``); without heartbeats they become safe by themselves.
        """
        not_stopped = self._end()
        if not_stopped:
            self._say_not_stopped(not_stopped, False)

    def _end(self) -> list[int]:
        self._finalizer.detach()
        try:
            return list(self._native.close())
        except BaseException:
            # Ctrl-C while it was waited for: the thread goes on, and the end of the program waits for it.
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

    # What has happened.

    def check(self) -> None:
        """Raises an error if a board was lost, has left its control loop by itself, or shares its number with another; once for each.

        Iterating a `monitor`, `values`, reading an output that is old, and the end of the context do the same.

        Raises:
            FaultError: ``lost``, ``left-loop`` or ``number-shared``, with ``.board``.
        """
        self._native.check()

    def events(self, after: int = 0) -> list[Event]:
        """What has happened on the bus, oldest first; the last 4096.

        Args:
            after: Only events with higher numbers.
        """
        return [Event(**event) for event in self._native.events(after)]

    def bus(self) -> BusState:
        """Load and frames of the bus."""
        return BusState(**self._native.bus())

    def record(self, path: _Path, *, overwrite: bool = False) -> Recording:
        """Records every frame of the bus, those of this chain among them, until the end of the context or ``.end()``.

        Args:
            path: ``.log`` is candump's form, ``.fzi`` FZI-CAN, ``.mcap`` MCAP; the profile goes into or beside it.
            overwrite: Write over a file that is there.
        """
        if not overwrite and Path(path).exists():
            raise UsageError(f"{os.fspath(path)}: is there already", "exists", next="overwrite=True writes over it")
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
            raise UsageError(f"{board!r} is no board: a number 0..31, or a name of the inventory", "usage")
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
    """A recording that is being written; a context manager that ends it."""

    def __init__(self, native: ChainRecording) -> None:
        self._native = native
        #: Frames that were written, and frames of other protocols that the form has no place for; when it has ended.
        self.frames = 0
        self.left_out = 0

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Ends the recording.

        Raises:
            FaultError: It could not be written whole (``recording``).
        """
        counts = self._native.end()
        if counts is not None:
            self.frames, self.left_out = counts
