"""Connecting: to a simulated controller, a serial port, an agent."""

from __future__ import annotations

import atexit
import contextlib
import getpass
import os
import weakref
from pathlib import Path

from openjtc import _native
from openjtc._native import Arm
from openjtc.errors import Error, UsageError
from openjtc.motion import FilePath
from openjtc.payload import Payload
from openjtc.robot import Robot

__all__ = ["connect"]

_open: weakref.WeakSet[Robot] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """A program that ends stops what it moves."""
    for robot in list(_open):
        with contextlib.suppress(Error):
            robot.close()


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
