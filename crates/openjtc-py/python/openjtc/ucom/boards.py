"""Boards of a chain: their identities, signals and values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Iterator

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from openjtc.ucom.values import ValuesByName

__all__ = ["Board", "BoardValues", "Signal", "Signals", "Value"]

#: Value of a signal in the unit of the signal. A switch is a bool. An unknown value is None.
Value = bool | int | float | None


@dataclass(frozen=True)
class Signal:
    """An input, an output or a parameter of a board. The signal defines the meaning of a word of 16 bits.

    Attributes:
        name: Name of the signal, without the unit in brackets.
        text: Name of the signal as the board sends it.
        index: Position of the word in the buffer, counted from 0.
        type: ``int16``, ``uint16``, ``hex`` or ``bool``.
        unit: Unit, such as ``deg``; empty if no signal table has a unit.
        scale: Units for each step of the word.
        offset: Value in units that the word 0 represents.
        minimum: Smallest value that may be written, in units.
        maximum: Largest value that may be written, in units.
        known: True if a signal table contains the signal. The values of any other signal are raw words.
    """

    name: str
    text: str
    index: int
    type: str
    unit: str
    scale: float
    offset: float
    minimum: float
    maximum: float
    known: bool


@dataclass(frozen=True)
class Signals:
    """All signals of a board.

    Attributes:
        board: Number of the board.
        description: Description that the board's application reports.
        inputs: Controller inputs, in the order of the buffer.
        outputs: Sensor outputs, in the order of the buffer.
        parameters: Parameters, in the order of the buffer.
    """

    board: int
    description: str
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    parameters: tuple[Signal, ...]

    def __iter__(self) -> Iterator[Signal]:
        yield from (*self.inputs, *self.outputs, *self.parameters)

    @classmethod
    def _of(cls, value: dict[str, Any]) -> Signals:
        inputs, outputs, parameters = (
            tuple(Signal(**one) for one in value[kind]) for kind in ("inputs", "outputs", "parameters")
        )
        return cls(value["board"], value["description"], inputs, outputs, parameters)


@dataclass(frozen=True)
class BoardValues:
    """Values of a board at one time, by the names of the signals. Values are in units if a signal table contains the signals.

    Attributes:
        board: Number of the board.
        time_s: Time at which the outputs arrived, s since the chain was opened; None: no outputs have arrived.
        age_s: Age of the outputs, s; None: no outputs have arrived.
        stale: True if the outputs are outdated, because no outputs arrive or the heartbeats of the board are missing.
        outputs: Sensor outputs, in the order of the buffer.
        inputs: Inputs that were set last, or the initial inputs of the board; None if both are unknown.
        parameters: Parameters that this chain has written, because a board cannot return its parameters. A value is None if the
            parameter was not written since the application started.
        units: Units by signal name, for signals whose unit is in a signal table.
    """

    board: int
    time_s: float | None
    age_s: float | None
    stale: bool
    outputs: dict[str, Value]
    inputs: dict[str, Value]
    parameters: dict[str, Value]
    units: dict[str, str]

    @property
    def array(self) -> NDArray[np.float64]:
        """Outputs of the board as an array of shape (M,), in the order of the buffer; a switch is 0 or 1."""
        return _array(self.outputs)

    @classmethod
    def _of(cls, value: dict[str, Any]) -> BoardValues:
        outputs, inputs, parameters = (dict(value[kind]) for kind in ("outputs", "inputs", "parameters"))
        units = {name: unit for group in value["units"] for name, unit in group.items()}
        return cls(value["board"], value["time_s"], value["age_s"], value["stale"], outputs, inputs, parameters, units)


def _array(values: dict[str, Value]) -> NDArray[np.float64]:
    return np.array([np.nan if one is None else float(one) for one in values.values()], dtype=np.float64)


@dataclass(frozen=True)
class Board:
    """A board, according to its answer to PC_INFO. The protocol has no hardware version. The flash number identifies
    the board.

    Attributes:
        number: Address of the board, which is its position in the chain, 1 to 31.
        name: Name of the board in the inventory; empty if the inventory has no name.
        flash_number: Number of the board's bootloader, which identifies the board.
        state: ``exloader``, ``programming``, ``started`` or ``running``.
        status: Names of the status bits that are set.
        program_id: Checksum of the board's application, which identifies the software version; None: no valid application.
        flash_date: Date at which the application was written, ``YYYY-MM-DD``; None: no valid application.
        description: Description that the board reports; empty if it was not requested or never arrived complete.
    """

    number: int
    name: str
    flash_number: int
    state: str
    status: tuple[str, ...]
    program_id: int | None
    flash_date: str | None
    description: str
    _chain: ValuesByName | None = field(default=None, repr=False, compare=False)

    @property
    def signals(self) -> Signals:
        """Inputs, outputs and parameters of the board.

        Raises:
            RefusedError: The application is not started, and the chain does not know its signal names (``no-application``).
            NoLinkError: The board does not answer.
        """
        return self._of_chain().signals(self.number)

    def values(self) -> BoardValues:
        """Returns the present values of the board."""
        return self._of_chain().board_values(self.number)[self.number]

    def _of_chain(self) -> ValuesByName:
        if self._chain is None:
            raise AttributeError("this board object belongs to no chain")
        return self._chain

    @classmethod
    def _of(cls, value: dict[str, Any], chain: ValuesByName) -> Board:
        return cls(**{**value, "status": tuple(value["status"])}, _chain=chain)
