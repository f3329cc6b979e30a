"""Connecting: to a simulated controller, a serial port, an agent."""

from __future__ import annotations

import atexit
import getpass
import os
import signal
import threading
import warnings
import weakref
from pathlib import Path
from types import FrameType

from openjtc import _native
from openjtc._native import Arm
from openjtc.errors import Error, UsageError
from openjtc.motion import FilePath
from openjtc.payload import Payload
from openjtc.robot import Robot

__all__ = ["connect"]

_open: weakref.WeakSet[Robot] = weakref.WeakSet()
#: The process that connected last.
_process = os.getpid()


@atexit.register
def _close_all() -> None:
    """A program that ends stops what it moves: all arms at once, then one after the other is waited for."""
    # In a child of the process that connected they are closed already: they are the parent's.
    robots = [robot for robot in list(_open) if not robot.is_closed]
    for robot in robots:
        robot._link.halt()
    for robot in robots:
        try:
            robot.close()
        except Error as error:
            warnings.warn(f"at the end of the program: {error}", RuntimeWarning, stacklevel=1)


def _end(number: int, frame: FrameType | None) -> None:
    if os.getpid() != _process:
        # A child has no arm to stop, and ends as ever.
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    raise SystemExit(128 + number)


def _catch_signals() -> None:
    """A program that a signal ends stops what it moves, too. Where somebody handles these signals already, that is left as it is."""
    global _process
    _process = os.getpid()
    if threading.current_thread() is not threading.main_thread():
        return
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _end)


def connect(
    target: str = "sim:",
    *,
    arm: Arm | FilePath | None = None,
    baud: int = 115_200,
    speed: float | None = 1.0,
    seed: int = 1,
    faults: str | None = None,
    payload: Payload | None = None,
    name: str | None = None,
    token: str | None = None,
    certificates: FilePath | None = None,
) -> Robot:
    """Connects to a controller.

    The end of the program stops what it moves, also at SIGTERM and SIGHUP: where nobody else handles them, the first connection in the main
    thread lets them raise `SystemExit` there. What nobody can handle, SIGKILL or a loss of power, stops nothing on a serial line; an agent
    stops the motion of a program that has gone.

    Args:
        target: ``sim:`` a simulated controller, drives and arm in this process, which hold the arm at once; ``/dev/ttyUSB0`` a serial
            port, by the agent that owns it where there is one; ``http://HOST:PORT`` or ``https://…`` an agent (``jtc serve``).
        arm: The arm, or its file (TOML, URDF); None: that of the controller, where it can be asked, else the built-in one. A controller
            that has another arm refuses motions.
        baud: Rate of a serial port, Bd.
        speed: Of the simulator, times real time; None: as fast as the computer is, with time that passes only while something is done.
        seed: Of the simulator's chances.
        faults: What goes wrong in the simulator, as the text of a fault file (``jtc help faults``).
        payload: What the simulated arm carries; its controller does not know of it.
        name: As an agent shows this program to others; None: user and program.
        token: Of an agent of somebody else; that of one's own is found.
        certificates: A PEM file that an agent at ``https://`` is trusted by; None: those of the system.

    Raises:
        NoLinkError: There is no such port or agent, or no controller answers.
    """
    _catch_signals()
    if arm is not None and not isinstance(arm, Arm):
        arm = Arm.load(Path(arm))
    if target.startswith("sim:"):
        if target != "sim:":
            raise UsageError(f"{target!r}: a simulator is `sim:`, its options are arguments", "target")
        numbers = payload._numbers() if payload else None
        return _kept(_native.Link.simulated(arm, seed, speed, faults, numbers))
    who = name or f"{_user()}: Python"
    trusted = None if certificates is None else Path(certificates)
    return _kept(_native.Link.open(target, arm, baud, who, token, trusted))


def _kept(link: _native.Link) -> Robot:
    robot = Robot(link)
    _open.add(robot)
    return robot


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"process {os.getpid()}"
