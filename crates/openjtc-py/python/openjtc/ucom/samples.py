"""Outputs of boards as a stream of samples and as tables."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openjtc._native import ChainSamples
from openjtc._optional import needed
from openjtc.ucom.boards import Value, _array

__all__ = ["Monitor", "OutputTable", "Sample", "to_numpy", "to_pandas"]


@dataclass(frozen=True)
class Sample:
    """All outputs of a board at one time.

    Attributes:
        time_s: Time at which the last output arrived, s since the chain was opened.
        board: Number of the board.
        outputs: Outputs by name, in the order of the buffer, in units if a signal table has them.
        missed: Number of incomplete sets of outputs that were dropped since the previous sample.
    """

    time_s: float
    board: int
    outputs: dict[str, Value]
    missed: int

    @property
    def array(self) -> NDArray[np.float64]:
        """Outputs as an array of shape (M,), in the order of the buffer; a switch is 0 or 1."""
        return _array(self.outputs)


@dataclass(frozen=True)
class OutputTable:
    """Outputs of one board over time.

    Attributes:
        names: Names of the M columns.
        time_s: Times of shape (N,), s since the chain was opened.
        values: Values of shape (N, M), in units if a signal table has them.
    """

    names: tuple[str, ...]
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]


class Monitor(Iterator[Sample]):
    """Iterator over samples as they arrive. The iterator ends after a time or a number of samples. `Chain.monitor`
    makes it.

    Raises:
        FaultError: A board was lost (``lost``), or has left its control loop by itself (``left-loop``). Each of these errors is raised only
            once.
        NoLinkError: No board has sent outputs for 3 s (``no-outputs``), or the bus is lost.
    """

    def __init__(self, native: ChainSamples, seconds: float | None, count: int | None) -> None:
        self._native = native
        self._end = None if seconds is None else time.monotonic() + seconds
        self._left = count

    def __next__(self) -> Sample:
        if self._left is not None and self._left <= 0:
            raise StopIteration
        left = None if self._end is None else self._end - time.monotonic()
        value = None if left is not None and left <= 0 else self._native.next(left)
        if value is None:
            raise StopIteration
        if self._left is not None:
            self._left -= 1
        return Sample(value["time_s"], value["board"], dict(value["outputs"]), value["missed"])

    @property
    def dropped(self) -> int:
        """Number of samples that were dropped because the program did not read them in time."""
        return self._native.dropped

    def to_numpy(self) -> dict[int, OutputTable]:
        """Reads all samples until the end, and returns the tables of `to_numpy`."""
        return to_numpy(self)

    def to_pandas(self) -> Any:
        """Reads all samples until the end, and returns the table of `to_pandas`."""
        return to_pandas(self)


def to_numpy(samples: Iterable[Sample]) -> dict[int, OutputTable]:
    """Returns the samples as one table per board. The keys are board numbers."""
    by_board: dict[int, list[Sample]] = {}
    for sample in samples:
        by_board.setdefault(sample.board, []).append(sample)

    def table(rows: list[Sample]) -> OutputTable:
        times = np.array([row.time_s for row in rows], dtype=np.float64)
        return OutputTable(tuple(rows[0].outputs), times, np.stack([row.array for row in rows]))

    return {board: table(rows) for board, rows in sorted(by_board.items())}


def to_pandas(samples: Iterable[Sample]) -> Any:
    """Returns samples as a ``pandas.DataFrame``: ``time_s``, ``board``, and a column for each output.

    If boards have different outputs, a row has NaN in the columns of other boards.

    Raises:
        ImportError: pandas is not installed; the message says how to install it.
    """
    pandas = needed("pandas")
    rows = [{"time_s": one.time_s, "board": one.board, **one.outputs} for one in samples]
    return pandas.DataFrame(rows, columns=None if rows else ["time_s", "board"])
