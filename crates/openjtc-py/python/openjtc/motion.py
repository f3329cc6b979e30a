"""A motion on its way, and an arm that is led by hand."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from openjtc import _native
from openjtc.errors import Error
from openjtc.results import Run

__all__ = ["Motion", "Teaching"]

Array = NDArray[np.float64]
FilePath: TypeAlias = "str | os.PathLike[str]"


class Motion:
    """A motion on its way. `Robot.pause`, `Robot.resume`, `Robot.stop` and `Robot.speed` act on it."""

    def __init__(self, native: _native.Motion, link: _native.Link) -> None:
        self._native = native
        self._link = link
        self._run: Run | None = None
        self._error: BaseException | None = None

    @property
    def progress(self) -> tuple[str, float, float]:
        """What is done (``waiting``, ``upload``, ``approach``, ``motion``), how far it is, and of how much: s, or segments of an upload."""
        return self._link.progress()

    @property
    def is_done(self) -> bool:
        """It is over, in whatever way."""
        return self._is_over(0.0)

    def _is_over(self, seconds: float | None) -> bool:
        if self._run is None and self._error is None:
            try:
                came = self._native.wait(seconds)
            except Exception as error:
                self._error = error
                return True
            if came is None:
                return False
            samples, self._error = came
            self._run = Run(samples)
            if isinstance(self._error, Error):
                self._error.run = self._run
        return True

    def wait(self, timeout: float | None = None) -> Run:
        """Waits for its end. Ctrl-C stops the arm first.

        Args:
            timeout: s; None: as long as it takes.

        Raises:
            TimeoutError: It is not over yet, and goes on.
            RefusedError: The check refuses it; nothing was sent.
            FaultError, DeviceError, NoLinkError: It ended in an error; ``run`` of the error is what was seen until then.
        """
        if not self._is_over(timeout):
            raise TimeoutError(f"the motion goes on after {timeout} s")
        if self._error is not None:
            raise self._error
        assert self._run is not None
        return self._run


class Teaching:
    """The arm is led by hand. It is held again when the context ends."""

    def __init__(self, link: _native.Link) -> None:
        self._link = link
        self._times: list[float] = []
        self._rows = np.empty((0, 6))

    def record(self, seconds: float) -> None:
        """Records where the arm is led for this time (s), behind what was recorded before."""
        times, rows = self._link.record_teaching(seconds)
        start = self._times[-1] + 0.04 if self._times else 0.0
        self._times += [start + t - (times[0] if times else 0.0) for t in times]
        self._rows = np.vstack([self._rows, rows])

    @property
    def time(self) -> Array:
        """Times of what was recorded (N,), s."""
        return np.array(self._times)

    @property
    def position(self) -> Array:
        """Where the arm was (N, 6), rad."""
        return self._rows.copy()

    def waypoints(self, tolerance: float = 0.01) -> Array:
        """As few of the positions as keep every other one within a tolerance of the straight legs between them.

        Args:
            tolerance: rad of the joint that is furthest.

        Returns:
            Waypoints (W, 6), rad, for `Robot.plan`.
        """
        return _native.thinned(self._rows, tolerance)


def options_of(
    name: str,
    approach: bool,
    speed: float,
    repeat: int,
    record: FilePath | None,
    overwrite: bool,
    accept_device_limits: bool,
) -> dict[str, Any]:
    return {
        "name": name,
        "approach": approach,
        "speed": float(speed),
        "repeat": repeat,
        "record": None if record is None else Path(record),
        "overwrite": overwrite,
        "accept_device_limits": accept_device_limits,
    }


def followed(motion: Motion, progress: bool | None) -> Run:
    """Waits with a bar: upload and motion, one after the other."""
    shown = ""
    with tqdm(disable=None if progress is None else not progress, leave=False) as bar:
        while not bar.disable and not motion._is_over(0.05):
            phase, done, total = motion.progress
            if phase != shown:
                shown = phase
                bar.reset(total=total or None)
                bar.set_description(phase or "motion")
                bar.unit = "s" if phase in ("motion", "approach") else ""
            bar.n = min(done, total) if total else 0
            bar.refresh()
    return motion.wait()
