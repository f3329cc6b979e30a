"""Tests of the controller that Python runs tick by tick. The outputs must be bit for bit equal to the outputs of the simulator's
controller. The controller must also work with drives written in Python."""

import numpy as np
import pytest

from openjtc import Arm, Trajectory, UsageError
from openjtc.control import Controller, Inputs, StatusReader, bus, encode
from openjtc.dynamics import Dynamics, Payload
from openjtc.sim import Simulator


def quintic(start, goal, seconds, step_ms=10):
    """Makes a motion from rest to rest."""
    start, goal = np.asarray(start, float), np.asarray(goal, float)
    u = np.linspace(0, 1, round(seconds * 1000 / step_ms) + 1)[:, None]
    way = goal - start
    return Trajectory(
        step_ms,
        start + way * u**3 * (10 - 15 * u + 6 * u**2),
        way * 30 * u**2 * (1 - 2 * u + u**2) / seconds,
        way * 60 * u * (1 - 3 * u + 2 * u**2) / seconds**2,
    )


def stepped_beside(simulator, controller, until, limit_ms=60_000, spoil=None):
    """Steps the simulator and the controller until `until()`. Returns the first millisecond in which an output differs, or None."""
    for ms in range(limit_ms):
        if until():
            return None
        simulator.step()
        inputs = simulator.inputs
        out = controller.tick(spoil(ms, inputs) if spoil else inputs)
        mine, its = out, simulator.outputs
        # The reset is not compared, because the simulator's outputs do not contain it.
        if (mine.bus, mine.host, mine.telemetry, mine.safety_output) != (
            its.bus,
            its.host,
            its.telemetry,
            its.safety_output,
        ):
            return ms
    raise AssertionError(f"still {simulator.telemetry} after {limit_ms} ms")


@pytest.mark.parametrize("which", ["as new", "stored arm"])
def test_the_bits_are_those_of_the_simulator(which):
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    arm = Arm.avena() if which == "stored arm" else None
    faults = """
        format = 2
        [[fault]]
        kind = "frames-lost"
        probability = 0.01
        in_state = "operate"
        for_s = 0.5
        [[fault]]
        kind = "tick-overrun"
        at_s = 2
        for_s = 0.003
    """
    simulator = Simulator(arm, seed=seed, faults=faults, answer_jitter_ms=1, watch=True)
    controller = Controller(arm)
    simulator.write(b"".join(encode.use_defaults()))
    assert stepped_beside(simulator, controller, lambda: simulator.telemetry.state == "HoldPos") is None
    start = simulator.position
    motion = quintic(start, start + rng.uniform(-0.4, 0.4, 6), 2.5)
    for frame in encode.trajectory(motion):
        simulator.write(frame)
    assert stepped_beside(simulator, controller, lambda: simulator.telemetry.trajectory == "Stop") is None
    simulator.write(encode.payload(Payload(0.5)) + encode.execute())
    assert stepped_beside(simulator, controller, lambda: simulator.telemetry.trajectory == "Finish") is None
    assert simulator.telemetry.tick > 6_000
    last = simulator.telemetry
    assert last == controller.telemetry and np.array_equal(last.torque, controller.telemetry.torque)
    parts = last.torque_model + last.torque_p + last.torque_i + last.torque_d + last.torque_friction + last.torque_other
    assert np.allclose(parts, last.torque, rtol=0, atol=1e-9)


def test_another_input_has_another_output():
    simulator = Simulator(watch=True)
    simulator.write(b"".join(encode.use_defaults()))

    def spoil(ms, inputs):
        """Drops the answer of joint 3 in millisecond 6000."""
        if ms != 6_000:
            return inputs
        return Inputs(**{**vars(inputs), "bus": [f for f in inputs.bus if f[0] & 0xF != 2]})

    differs = stepped_beside(simulator, Controller(), lambda: False, limit_ms=6_010, spoil=spoil)
    assert differs == 6_000


class Drives:
    """Seven nodes on their own bus. Each joint has an inertia of 2 kg·m², and neither gravity nor friction."""

    def __init__(self):
        self.state = [bus.INIT] * 7
        self.position, self.velocity, self.torque = np.zeros(6), np.zeros(6), np.zeros(6)

    def answers(self, frame):
        request = bus.parse(frame) if frame else None
        if isinstance(request, bus.Move):
            self.torque = np.where([s == bus.ENABLED for s in self.state[:6]], request.torque, 0.0)
            joints = zip(self.position, self.velocity, self.state)
            reports = [bus.joint_answer(n, q, v, state=s) for n, (q, v, s) in enumerate(joints)]
            return [*reports, bus.gripper_answer(state=self.state[6])]
        if isinstance(request, bus.ChangeState):
            answers = [bus.state_answer(node, state) for node, state in enumerate(self.state)]
            self.state = [target or state for target, state in zip(request.target, self.state)]
            return answers
        if isinstance(request, bus.Configure):
            return [bus.configured_answer(node) for node in range(7)]
        return []


def test_drives_in_python_are_brought_up_and_held_until_they_are_silent():
    controller, drives, statuses = Controller(), Drives(), StatusReader()
    answers, host, seen = [], b"".join(encode.use_defaults()), []
    model = Dynamics(Arm.avena())
    for _ in range(4_000):
        out = controller.tick(Inputs(bus=answers, host=host))
        answers, host = drives.answers(out.bus), b""
        seen += statuses.feed(out.host)
        # The controller compensates gravity, but gravity does not act on these joints. The test therefore
        # subtracts the gravity torque.
        load = drives.torque - model.gravity(drives.position) if drives.state[0] == bus.ENABLED else np.zeros(6)
        drives.velocity = drives.velocity + load / 2.0 * 1e-3
        drives.position = drives.position + drives.velocity * 1e-3
    assert controller.telemetry.state == "HoldPos" and drives.state == [bus.ENABLED] * 7
    assert np.abs(drives.position).max() < 0.01
    assert np.allclose(drives.torque, model.gravity(drives.position), atol=5.0)
    assert [s.response.accepted for s in seen if s.response] == [True] * 3
    assert seen[-1].state == "HoldPos" and seen[-1].errors == 0 and controller.time == 4.0
    for _ in range(200):
        seen += statuses.feed(controller.tick(Inputs(acknowledged=False)).host)
    assert seen[-1].state == "Error" and seen[-1].errors != 0 and seen[-1].causes
    assert np.array_equal(bus.parse(controller.tick().bus).torque, np.zeros(6))


def test_a_timer_that_does_not_come_is_reset_by_the_watchdog():
    controller = Controller()
    controller.tick()
    held = [controller.tick().safety_output for _ in range(3)][-1]
    missed = [controller.tick(Inputs(ticked=False)) for _ in range(10)]
    assert [out.reset for out in missed] == [False] * 9 + [True]
    assert [out.safety_output for out in missed] == [held] * 9 + [False] and held, "a pin keeps its level until the reset"


def test_wrong_frames_are_refused():
    controller = Controller()
    with pytest.raises(UsageError, match="not a CAN FD data frame"):
        controller.tick(Inputs(bus=[(0x1234, b"")]))
    with pytest.raises(UsageError, match=r"node: 6 is out of range \(0 to 5\)"):
        bus.joint_answer(6, 0.0, 0.0)
    with pytest.raises(UsageError):
        bus.parse((0x2F0, b"\x01"))
    with pytest.raises(UsageError, match="points_a_frame"):
        encode.trajectory(quintic([0] * 6, [1] * 6, 1), points_a_frame=0)
    empty = np.zeros((0, 6))
    with pytest.raises(UsageError, match="at least 2"):
        Trajectory(10, empty, empty, empty).at_speed(70)
    with pytest.raises(UsageError, match="at most 100"):
        encode.trajectory(quintic([0] * 6, [1] * 6, 10), points_a_frame=1)


def test_frames_of_the_host_are_the_worked_bytes_of_the_protocol():
    worked = {
        encode.execute: "9B 0B 00 07 03 7D 9E",
        encode.stop: "9B 0B 00 07 01 5D DC",
        encode.pause: "9B 0B 00 07 02 6D BF",
        encode.teach: "9B 0C 00 06 CD 27",
        encode.hold: "9B 0D 00 06 FA 17",
        encode.clear_errors: "9B 01 00 0A 01 7F 00 00 6A D8",
    }
    for make, expected in worked.items():
        assert make() == bytes.fromhex(expected)
    assert encode.pump(True) == bytes.fromhex("9B 11 00 0A 01 00 00 00 A9 9A")
    assert [frame.hex(" ") for frame in encode.use_defaults()] == [
        "9b 0f 00 06 94 77",
        "9b 0a 00 06 7f 87",
        "9b 08 00 06 11 e7",
    ]
    arm = Arm.avena()
    friction, model, gains = encode.parameters(arm)
    assert len(model) == 6 + 4 * (42 + 91)
    assert len(gains) == 6 + 4 * 30 and len(friction) == 6 + 4 * 36
    points = quintic([0] * 6, [0.5] * 6, 2.0)
    frames = encode.trajectory(points, points_a_frame=64)
    assert [len(f) for f in frames] == [14 + 36 * n for n in (64, 64, 64, 9)]
