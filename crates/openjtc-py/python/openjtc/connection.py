"""Connections to a simulated controller, a serial port or an agent."""

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
#: Process that made the last connection.
_process = os.getpid()


@atexit.register
def _close_all() -> None:
    """Stops the motions of all connections when the program ends. First sends a Stop to every arm, and then waits for each arm in turn."""
    # In a child process, the connections count as closed, because they belong to the parent
    # process.
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
        # A child process has no arm to stop, so the signal ends the child process as usual.
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    raise SystemExit(128 + number)


def _catch_signals() -> None:
    """Installs signal handlers, so that a program that ends by a signal also stops its motions. Existing signal handlers stay installed."""
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

    The end of the program stops its motions. This includes an end by SIGTERM or SIGHUP. If the program has no handler for these
    signals, the first connection in the main thread installs handlers that raise `SystemExit`. SIGKILL and a loss of power cannot be
    handled. After a kill or a loss of power, a motion on a serial line continues, but an agent stops the motion of a program that has
    disconnected.

    Args:
        target: ``sim:`` for a simulated controller with drives and arm in this process, which holds the arm at once; ``/dev/ttyUSB0`` for a
            serial port, through the agent that owns the port, if any; ``http://HOST:PORT`` or ``https://…`` for an agent (``jtc serve``).
        arm: The arm, or its file (TOML, URDF); None: the controller's arm if the controller can report it, otherwise the built-in arm. If
            the controller has another arm, motions are refused.
        baud: Rate of a serial port, Bd.
        speed: Speed of the simulator, times real time; None: as fast as possible; simulated time then passes only during calls.
        seed: Seed of the simulator's random numbers.
        faults: Faults in the simulator, as the text of a fault file (``jtc help faults``).
        payload: Payload of the simulated arm; the controller does not know this payload.
        name: Name under which an agent shows this program to other clients; None: user and program.
        token: Token for another user's agent; the token of your own agent is found automatically.
        certificates: PEM file with the certificates for an agent at ``https://``; None: the certificate of your own agent, otherwise the
            certificates of the system.

    Raises:
        NoLinkError: The port or agent does not exist, or no controller answers.
    """
    _catch_signals()
    if arm is not None and not isinstance(arm, Arm):
        arm = Arm.load(Path(arm))
    if target.startswith("sim:"):
        if target != "sim:":
            raise UsageError(f"{target!r}: not a valid target, expected `sim:`; options of the simulator are arguments", "target")
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
