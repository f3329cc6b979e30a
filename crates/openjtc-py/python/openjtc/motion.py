"""A motion on its way, and an arm that is led by hand."""

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
    """A motion on its way. `Robot.pause`, `Robot.resume` and `Robot.speed` act on it, too.

    It may be waited for and looked at from several threads. As long as it is there, the robot is: the end of the program stops it.
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
        """What is done (``waiting``, ``upload``, ``approach``, ``motion``; empty when it is over), how far it is, and of how much: s, or
        segments of an upload."""
        return self._native.progress()

    @property
    def is_done(self) -> bool:
        """It is over, in whatever way."""
        return self._is_over(0.0)

    def _is_over(self, seconds: float | None) -> bool:
        if self._run is not None or self._error is not None:
            return True
        try:
            came = self._native.wait(seconds)
        except UsageError:
            # The time is none.
            raise
        except Exception as error:
            self._error = error
            return True
        except BaseException:
            # Ctrl-C has stopped it: who asks for what came of it then knows that.
            self._stopped = True
            raise
        if came is None:
            return False
        samples, error_of_run = came
        run = Run(samples)
        if isinstance(error_of_run, Error):
            error_of_run.run = run
        # The run last: it is what others look at.
        self._error, self._run = error_of_run, run
        return True

    def stop(self) -> None:
        """Stops the arm on its path, as `Robot.stop` does; that the motion was stopped is no error of `wait` then."""
        self._stopped = True
        self._robot.stop()

    def wait(self, timeout: float | None = None) -> Run:
        """Waits for its end. Ctrl-C stops the arm first.

        Args:
            timeout: s; None: as long as it takes.

        Returns:
            What was seen. Its outcome is ``stopped`` where `stop` of this motion stopped it, or `Robot.stop` or `Robot.close` called in the
            thread that waits.

        Raises:
            TimeoutError: It is not over yet, and goes on.
            RefusedError: The check refuses it; nothing was sent.
            StoppedError: Somebody else stopped it.
            FaultError, DeviceError, NoLinkError: It ended in an error; ``run`` of the error is what was seen until then.
        """
        if not self._is_over(timeout):
            raise TimeoutError(f"the motion goes on after {timeout} s")
        return self._ended(self._stopped or self._robot._stopped_since(self._asked))

    def _ended(self, own: bool) -> Run:
        """What came of it; `own`: whoever asks has stopped it, where it was stopped."""
        if self._error is not None:
            raise self._error
        assert self._run is not None
        if self._run.outcome == "stopped" and not own:
            error = StoppedError(
                "the motion was stopped on its way, and not by who waits for it",
                "stopped",
                next="find out who stopped it, and why; what is asked for from now on is done",
            )
            error.run = self._run
            raise error
        return self._run


class Teaching:
    """The arm is led by hand. It is held again when the context ends, and as soon as somebody stops the arm."""

    def __init__(self, link: _native.Link) -> None:
        self._link = link
        self._times: list[float] = []
        self._rows = np.empty((0, 6))

    def record(self, seconds: float) -> None:
        """Records where the arm is led for this time (s, up to 3600), behind what was recorded before. What was recorded by the time of an
        error, or of Ctrl-C, is there all the same.

        Raises:
            FaultError: The arm is not taught any more, or the controller reports an error.
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
    asked: int,
    name: str,
    approach: bool,
    speed: float | None,
    repeat: int,
    record: FilePath | None,
    overwrite: bool,
    accept_device_limits: bool,
) -> dict[str, Any]:
    """What a motion is run with. `asked`: how many Stops there had been when it was asked for."""
    count = operator.index(repeat)
    if not 1 <= count < 2**32:
        limit = 1 if count < 1 else 2**32 - 1
        raise UsageError(
            f"repeat: {count} is outside 1..{2**32 - 1}; nothing was sent", "usage", value=float(count), limit=float(limit)
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
    """Begins a motion and waits for it with a bar: upload and motion, one after the other."""
    motion: Motion | None = None
    try:
        motion = begin()
        _show(motion, progress)
    except BaseException as error:
        # The arm does not go on where nobody waits for it any more: Ctrl-C in Python's own code, or a bar that cannot be drawn. What keeps a
        # motion from beginning has begun nothing.
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
