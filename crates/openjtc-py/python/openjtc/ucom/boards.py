"""Boards of a chain: who each is, its signals, and their values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Iterator

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from openjtc.ucom.values import ValuesByName

__all__ = ["Board", "BoardValues", "Signal", "Signals", "Value"]

#: A value of a signal in its unit; a bool for a switch. None where it is not known.
Value = bool | int | float | None


@dataclass(frozen=True)
class Signal:
    """An input, an output or a parameter of a board: what its word of 16 bits means.

    Attributes:
        name: Its name, without the unit in brackets behind it.
        text: Its name as the board sends it.
        index: Its place in the buffer, from 0.
        type: ``int16``, ``uint16``, ``hex`` or ``bool``.
        unit: As ``deg``; empty where no signal table has one.
        scale: Units for each step of the word.
        offset: What the word 0 means, in units.
        minimum: Smallest value that may be written, in units.
        maximum: Largest value that may be written, in units.
        known: It comes from a signal table; otherwise values are bare words.
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
        board: The number of the board.
        description: What its application reports about itself.
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
    """The values of a board at a time, by the names of its signals, in their units where a signal table has them.

    Attributes:
        board: The number of the board.
        time_s: When its outputs came, s since the chain was opened; None: none came.
        age_s: How old its outputs are, s; None: none came.
        stale: Its outputs are no more the present ones: none come, or its heartbeats are missing.
        outputs: Sensor outputs, in the order of the buffer.
        inputs: Inputs as last set or as the board wants them first; None where neither is known.
        parameters: Parameters as this chain wrote them. Boards have no way to read them back: None where nothing was written
            since the application started.
        units: Units by name, as far as a signal table has them.
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
        """The outputs as an array of shape (M,), in the order of the buffer; a switch is 0 or 1."""
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
    """A board as it answered to PC_INFO. The protocol has no version of the hardware: the flash number is who it is.

    Attributes:
        number: Its address, which is its place in the chain, 1 to 31.
        name: What people call it, by the inventory; empty where that has no name.
        flash_number: The number of its bootloader: its identity.
        state: ``exloader``, ``programming``, ``started`` or ``running``.
        status: The names of the status bits that are set.
        program_id: The checksum of its application: the version of its software; None: it has no valid application.
        flash_date: When that was written, ``YYYY-MM-DD``; None: it has no valid application.
        description: What it reports about itself; empty where that was not asked for, or never came whole.
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
        """Its inputs, outputs and parameters.

        Raises:
            RefusedError: Its application is not started, and its names are not remembered from before (``no-application``).
            NoLinkError: It does not answer.
        """
        return self._of_chain().signals(self.number)

    def values(self) -> BoardValues:
        """Its values now."""
        return self._of_chain().board_values(self.number)[self.number]

    def _of_chain(self) -> ValuesByName:
        if self._chain is None:
            raise AttributeError("this board was made by hand: no chain has it")
        return self._chain

    @classmethod
    def _of(cls, value: dict[str, Any], chain: ValuesByName) -> Board:
        return cls(**{**value, "status": tuple(value["status"])}, _chain=chain)
