"""Running motions, and teaching by hand."""

from __future__ import annotations

import operator
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from openjtc import _native
from openjtc.errors import Error, StoppedError, UsageError
from openjtc.results import Run

if TYPE_CHECKING:
    from openjtc.robot import Robot

__all__ = ["Motion", "Teaching"]

Array = NDArray[np.float64]
FilePath: TypeAlias = "str | os.PathLike[str]"


class Motion:
    """A running motion. `Robot.pause`, `Robot.resume` and `Robot.speed` also act on this motion.

    Several threads may use one motion. A motion keeps its robot open. The end of the program stops the motion.
    """

    def __init__(self, native: _native.Motion, robot: Robot, asked: int) -> None:
        self._native = native
        self._robot = robot
        self._asked = asked
        self._stopped = False
        self._run: Run | None = None
        self._error: Exception | None = None

    @property
    def progress(self) -> tuple[str, float, float]:
        """Phase (``waiting``, ``upload``, ``approach``, ``motion``; empty after the end), completed part of the phase and total. The unit
        is s, or segments of an upload."""
        return self._native.progress()

    @property
    def is_done(self) -> bool:
        """True if the motion has ended, with or without an error."""
        return self._is_over(0.0)

    def _is_over(self, seconds: float | None) -> bool:
        if self._run is not None or self._error is not None:
            return True
        try:
            came = self._native.wait(seconds)
        except UsageError:
            # If `seconds` is not a valid time, the error is raised.
            raise
        except Exception as error:
            self._error = error
            return True
        except BaseException:
            # Ctrl-C has stopped the motion, so a later `wait` must not raise an error for this stop.
            self._stopped = True
            raise
        if came is None:
            return False
        samples, error_of_run = came
        run = Run(samples)
        if isinstance(error_of_run, Error):
            error_of_run.run = run
        # `_run` is set last, because other threads read it to check whether the motion has ended.
        self._error, self._run = error_of_run, run
        return True

    def stop(self) -> None:
        """Stops the arm on its path, like `Robot.stop`. A later `wait` does not raise a `StoppedError` for this stop."""
        self._stopped = True
        self._robot.stop()

    def wait(self, timeout: float | None = None) -> Run:
        """Waits until the motion ends. Ctrl-C stops the arm first.

        Args:
            timeout: Longest wait, s; None: without limit.

        Returns:
            The run. The outcome of the run is ``stopped`` after `stop` of this motion, or after `Robot.stop` or `Robot.close` in the
            waiting thread.

        Raises:
            TimeoutError: The motion has not ended yet, and continues.
            RefusedError: The check refused the trajectory. No frame was sent.
            StoppedError: Another thread or program stopped the motion.
            FaultError, DeviceError, NoLinkError: The motion ended in an error. ``run`` of the error has the samples until then.
        """
        if not self._is_over(timeout):
            raise TimeoutError(f"the motion has not ended after {timeout} s")
        return self._ended(self._stopped or self._robot._stopped_since(self._asked))

    def _ended(self, own: bool) -> Run:
        """Returns the run, or raises the error of the run. `own` is true if the caller itself stopped the motion."""
        if self._error is not None:
            raise self._error
        assert self._run is not None
        if self._run.outcome == "stopped" and not own:
            error = StoppedError(
                "another client or thread stopped the motion on its path",
                "stopped",
                next="find out who stopped the arm and why; new requests are executed",
            )
            error.run = self._run
            raise error
        return self._run


class Teaching:
    """An arm that is guided by hand. The controller holds the arm again when the context ends or after a Stop."""

    def __init__(self, link: _native.Link) -> None:
        self._link = link
        self._times: list[float] = []
        self._rows = np.empty((0, 6))

    def record(self, seconds: float) -> None:
        """Records the positions of the arm for this time (s, up to 3600), and appends them to the positions recorded earlier.

        After an error or Ctrl-C, the positions recorded until then are kept.

        Raises:
            FaultError: Teaching has ended, or the controller reports an error.
        """
        self._link.take_taught()
        try:
            self._link.record_teaching(seconds)
        finally:
            times, rows = self._link.take_taught()
            start = self._times[-1] + 0.04 if self._times else 0.0
            self._times += [start + t - (times[0] if times else 0.0) for t in times]
            self._rows = np.vstack([self._rows, rows])

    @property
    def time(self) -> Array:
        """Times of the recorded positions (N,), s."""
        return np.array(self._times)

    @property
    def position(self) -> Array:
        """Recorded joint positions (N, 6), rad."""
        return self._rows.copy()

    def waypoints(self, tolerance: float = 0.01) -> Array:
        """Reduces the recorded positions to waypoints. Every removed position is within `tolerance` of the straight lines between the
        waypoints.

        Args:
            tolerance: Largest deviation of any joint, rad.

        Returns:
            Waypoints (W, 6), rad, for `Robot.plan`.
        """
        return _native.thinned(self._rows, tolerance)


def options_of(
    asked: int,
    name: str,
    approach: bool,
    speed: float | None,
    repeat: int,
    record: FilePath | None,
    overwrite: bool,
    accept_device_limits: bool,
) -> dict[str, Any]:
    """Collects the options of a motion. `asked` is the number of Stops at the time of the request."""
    count = operator.index(repeat)
    if not 1 <= count < 2**32:
        limit = 1 if count < 1 else 2**32 - 1
        raise UsageError(
            f"repeat: {count} is out of range (1 to {2**32 - 1}); nothing was sent", "usage", value=float(count), limit=float(limit)
        )
    return {
        "asked": asked,
        "name": name,
        "approach": approach,
        "speed": None if speed is None else float(speed),
        "repeat": count,
        "record": None if record is None else Path(record),
        "overwrite": overwrite,
        "accept_device_limits": accept_device_limits,
    }


def followed(robot: Robot, begin: Callable[[], Motion], progress: bool | None) -> Run:
    """Begins a motion and waits for its end. A progress bar shows first the upload and then the motion."""
    motion: Motion | None = None
    try:
        motion = begin()
        _show(motion, progress)
    except BaseException as error:
        # Ctrl-C in Python code, or an error of the progress bar, may interrupt the wait. The arm is then stopped,
        # because no caller waits for the motion any more. An `Exception` before the start leaves no motion to stop.
        if motion is not None or not isinstance(error, Exception):
            robot._link.rest()
        raise
    return motion.wait()


def _show(motion: Motion, progress: bool | None) -> None:
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
