"""Real-time control of six-axis, torque-controlled robot arms.

Four lines move an arm, real or simulated::

    import openjtc

    with openjtc.connect("sim:") as robot:
        print(robot.move([0, 30, -60, 0, 30, 0], degrees=True))

Joints are counted from 1, base to wrist; arrays have one column per joint. Angles are in rad, torques in N·m and times in s,
unless a name says otherwise.

- `connect` and `Robot`: motions, jogging, teaching, arms, payloads, the flight recorder of one controller.
- `Planner`: motions from poses and waypoints within all limits, without a controller.
- `openjtc.dynamics`: kinematics and dynamics of an arm, vectorised.
- `openjtc.sim`: the simulated arm step by step, with the real controller or with your own controller.
- `openjtc.control`: the control code of the boards, tick by tick.
- `openjtc.ucom`: chains of UCoM boards.
"""

from openjtc._native import Arm, Trajectory, __version__
from openjtc._native import example_text as example_text
from openjtc.connection import connect
from openjtc.errors import (
    DeviceError,
    Error,
    FaultError,
    HeldStopError,
    NoLinkError,
    RefusedError,
    StoppedError,
    UsageError,
)
from openjtc.motion import Motion, Teaching
from openjtc.payload import Payload
from openjtc.planning import Planner
from openjtc.results import Check, FlightLog, JointFigures, Plan, Run, Samples
from openjtc.robot import Robot
from openjtc.status import Finding, HeldStop, Status

__all__ = [
    "Arm",
    "Check",
    "DeviceError",
    "Error",
    "FaultError",
    "Finding",
    "FlightLog",
    "HeldStop",
    "HeldStopError",
    "JointFigures",
    "Motion",
    "NoLinkError",
    "Payload",
    "Plan",
    "Planner",
    "RefusedError",
    "Robot",
    "Run",
    "Samples",
    "Status",
    "StoppedError",
    "Teaching",
    "Trajectory",
    "UsageError",
    "__version__",
    "connect",
    "example",
    "example_text",
]


def example(name: str) -> Trajectory:
    """Returns an example trajectory by its name: ``motion``, ``lines`` …; ``jtc example`` lists the names.

    Raises:
        UsageError: The name of the trajectory is unknown; the message lists the valid names.
    """
    return Trajectory.parse(example_text(name))
