"""Boards of a chain, and their values by name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from openjtc import _native
from openjtc._native import SimulatedChain
from openjtc.errors import UsageError
from openjtc.ucom.boards import Board, BoardValues, Signals, Value
from openjtc.ucom.reports import ScanReport
from openjtc.ucom.samples import Monitor
from openjtc.ucom.session import Boards, Session

__all__ = ["Settable", "ValuesByName"]

#: A value that a caller sets: a number, a number with its unit (``"15.5 deg"``), a raw word (``"0x05DC"``),
#: or a switch.
Settable = bool | int | float | str
_Path = str | os.PathLike[str]


def _text(value: Settable, unit: str = "") -> str:
    """Returns a value as text, in the form that `ucom` uses."""
    if isinstance(value, str):
        return f"{value} {unit}".strip()
    if isinstance(value, bool):
        return "on" if value else "off"
    number = int(value) if float(value).is_integer() else float(value)
    return f"{number!r} {unit}".strip()


def _value(value: Any) -> Value:
    assert value is None or isinstance(value, (bool, int, float))
    return value


class ValuesByName(Session):
    """Boards and values of a chain; see `openjtc.ucom.Chain`."""

    def __init__(self, native: _native.Chain, names: Mapping[str, int], simulated: SimulatedChain | None) -> None:
        super().__init__(native, names, simulated)
        self._boards: dict[int, Board] = {}
        #: True after a scan has read the names of the inventory.
        self._looked = False

    def scan(self) -> ScanReport:
        """Queries all boards, without changing anything.

        Raises:
            NoLinkError: No board answers (``no-boards``).
            RefusedError: Two boards have one number (``number-shared``).
        """
        value = self._native.scan()
        return ScanReport(self._keep(value["boards"]), tuple(value["reports"]), tuple(value["findings"]))

    @property
    def boards(self) -> dict[int, Board]:
        """Boards by number, according to their last answers. The first use queries all boards."""
        if not self._boards:
            self.scan()
        return dict(self._boards)

    def signals(self, board: int | str) -> Signals:
        """Returns the inputs, outputs and parameters of a board.

        Raises:
            RefusedError: The application is not started, and the chain does not know its signal names (``no-application``). Call `start`.
        """
        (value,) = self._native.signals(str(self._number(board)))
        return Signals._of(value)

    def initial_inputs(self, board: int | str) -> dict[str, Value]:
        """Reads the initial inputs that a board requests. The application of the board must be started."""
        return dict(self._native.initial_inputs(self._number(board)))

    def set(
        self,
        name: str,
        value: Settable,
        *,
        unit: str = "",
        kind: Literal["input", "parameter"] | None = None,
        force: bool = False,
    ) -> Value:
        """Sets an input, or writes a parameter.

        An input is sent at once, and is repeated while the board runs. Parameters cannot be read back from a board, and the board loses its
        parameters when its application ends.

        Args:
            name: ``BOARD.NAME``, in upper or lower case. The signal name alone is sufficient if only one board has this signal.
            value: A number, ``"15.5 deg"``, a word ``"0x05DC"``, or a switch.
            unit: Unit of the value. A signal with a unit in the signal table refuses numbers without a unit.
            kind: Selects the input or the parameter if both have the same name; None: the input.
            force: Continues even if another PC is on the bus.

        Returns:
            The value that was sent, in the unit of the signal, rounded to the nearest word.

        Raises:
            UsageError: No board has this signal (``no-edge``).
            RefusedError: The value to set is out of range or lacks its unit (``value``, with ``.value`` and ``.limit``).
        """
        board, signal = self._find(name)
        return _value(self._native.set(board, kind, signal, _text(value, unit), force))

    def __setitem__(self, name: str, value: Settable) -> None:
        self.set(name, value)

    def __getitem__(self, name: str) -> Value:
        """Returns an output by its name. If no output has this name, returns the input that was set last, or the parameter that was
        written last (None: not known).

        Raises:
            NoLinkError: The board has sent no outputs at all (``no-outputs``), or no outputs for 0.5 s (``stale``).
            FaultError: The board was lost, or has left its control loop by itself.
        """
        board, signal = self._find(name)
        return _value(self._native.value(board, signal))

    def values(self) -> dict[str, Value]:
        """Returns the present outputs of all boards that this chain runs, by ``NUMBER.NAME``. `board_values` also returns old outputs.

        Raises:
            FaultError: A board was lost, or has left its control loop by itself.
            NoLinkError: A board has sent no outputs at all (``no-outputs``), or no outputs for 0.5 s (``stale``), with ``.board``.
        """
        self.check()
        boards = [BoardValues._of(value) for value in self._native.running()]
        return {f"{one.board}.{name}": value for one in boards for name, value in one.outputs.items()}

    def board_values(self, boards: Boards = "all") -> dict[int, BoardValues]:
        """Returns the outputs of boards with their age, and the inputs and parameters. Includes boards that another program runs.

        ``all`` omits boards whose signal names are not known, because their applications are not started.
        """
        all_values = (BoardValues._of(value) for value in self._native.values(self._list(boards)))
        return {one.board: one for one in all_values}

    def monitor(
        self, boards: Boards | None = None, *, seconds: float | None = None, count: int | None = None
    ) -> Monitor:
        """Returns an iterator over the outputs as they arrive, as `Sample`. ``.to_pandas()`` and ``.to_numpy()`` make tables from the
        iterator.

        Args:
            boards: Boards to read, including boards that another program runs; None: the boards that this chain runs, or all boards if it
                runs none. ``all`` omits boards whose signal names are not known, because their applications are not started.
            seconds: Time after which the iterator ends, s.
            count: Number of samples after which the iterator ends.
        """
        return Monitor(self._native.samples(None if boards is None else self._list(boards)), seconds, count)

    def save_parameters(self, path: _Path, boards: Boards = "all") -> None:
        """Writes a parameter file, YAML. The parameter file contains the values written last, and all other names as comments."""
        Path(path).write_text(self._native.parameters_text(self._list(boards)), encoding="utf-8")

    def apply_parameters(self, path: _Path, *, dry_run: bool = False, force: bool = False) -> int:
        """Checks a whole parameter file against boards, programs, names and ranges, then writes the parameters. Returns the number of
        parameters."""
        return self._native.apply_parameters(os.fspath(path), dry_run, force)

    def _keep(self, boards: list[dict[str, Any]]) -> tuple[Board, ...]:
        all_boards = tuple(Board._of(one, self) for one in boards)
        self._boards = {board.number: board for board in all_boards}
        self._inventory_names = {board.name.lower(): board.number for board in all_boards if board.name}
        self._looked = True
        return all_boards

    def _forget_boards(self) -> None:
        """Forgets board numbers and signal names, because they may belong to other boards from now on."""
        self._boards, self._inventory_names, self._looked = {}, {}, False

    def _named(self, name: str) -> int | None:
        number = super()._named(name)
        # A scan reads the names of the inventory. Lists and ranges of boards are not names.
        if number is None and not self._looked and any(letter.isalpha() for letter in name):
            self.scan()
            number = super()._named(name)
        return number

    def _seen(self, boards: list[dict[str, Any]], whole: bool = False) -> dict[int, Board]:
        for one in boards:
            known = self._boards.get(one["number"])
            if not whole and not one["description"] and known and known.flash_number == one["flash_number"]:
                one["description"] = known.description
        seen = {one["number"]: Board._of(one, self) for one in boards}
        self._boards.update(seen)
        return seen

    def _find(self, name: str) -> tuple[int, str]:
        """Splits a name into the board and the signal."""
        first, dot, rest = name.partition(".")
        number = self._named(first) if dot else None
        if number is not None and rest:
            return self._number(number), rest
        short = name.strip().lower()
        found = [
            number
            for number in self.boards
            if any(short in (signal.name.lower(), signal.text.lower()) for signal in self.signals(number))
        ]
        if len(found) == 1:
            return found[0], name
        if not found:
            raise UsageError(f"no board has a signal {name!r}", "no-edge", next="find the names with boards[N].signals")
        listed = ", ".join(f"{number}.{name}" for number in found)
        raise UsageError(f"several boards have a signal {name!r}", "no-edge", next=f"use one of {listed}")

    def _given(self, values: Mapping[str, Settable]) -> list[tuple[int | None, str, str]]:
        def one(name: str, value: Settable) -> tuple[int | None, str, str]:
            first, dot, rest = name.partition(".")
            number = self._named(first) if dot else None
            return (None, name, _text(value)) if number is None else (number, rest, _text(value))

        return [one(name, value) for name, value in values.items()]
