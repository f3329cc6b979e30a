"""Tests of the values that a connection takes and returns: refused values, unknown values, and a different arm."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import openjtc
import pytest

HOME = np.array([0.0, 0.5, -1.0, 0.0, 0.5, 0.0])
NAN, INF = float("nan"), float("inf")


@pytest.fixture
def robot():
    with openjtc.connect("sim:", speed=None) as robot:
        yield robot


def test_odd_numbers_are_refused_with_value_and_limit(robot):
    plan = robot.plan([robot.position, HOME])
    refused = [
        (lambda: robot.run(plan, repeat=0), 0.0, 1.0),
        (lambda: robot.run(plan, repeat=-3), -3.0, 1.0),
        (lambda: robot.run(plan, repeat=2**40), 2.0**40, 2.0**32 - 1),
        (lambda: robot.move(HOME, speed=0.5), 0.5, 1.0),
        (lambda: robot.move(HOME, speed=101), 101.0, 100.0),
        (lambda: robot.move(HOME, margin=-1), -1.0, 0.0),
        (lambda: robot.plan([robot.position, HOME], margin=50.5), 50.5, 50.0),
        (lambda: openjtc.Planner(margin=100), 100.0, 50.0),
        (lambda: robot.jog(0.1, 601.0, joint=1), 601.0, 600.0),
        (lambda: robot.jog(0.1, -1.0, joint=1), -1.0, 0.0),
        (lambda: robot.jog(0.1, INF, joint=1), INF, 600.0),
        (lambda: setattr(robot, "speed", 0.01), 0.01, 0.05),
        (lambda: setattr(robot, "speed", 1.5), 1.5, 1.0),
    ]
    for act, value, limit in refused:
        with pytest.raises(openjtc.UsageError) as caught:
            act()
        assert (caught.value.value, caught.value.limit) == (value, limit), caught.value
    with robot.teach() as teaching:
        for seconds in (NAN, -1.0, 3601.0, INF):
            with pytest.raises(openjtc.UsageError):
                teaching.record(seconds)
    motion = robot.start(plan)
    for act in (
        lambda: robot.jog(0.1, NAN, joint=1),
        lambda: robot.wait_ready(NAN),
        lambda: motion.wait(NAN),
        lambda: robot.move(HOME, speed=NAN),
        lambda: setattr(robot, "speed", NAN),
    ):
        with pytest.raises(openjtc.UsageError) as caught:
            act()
        assert np.isnan(caught.value.value)
    # An invalid timeout must not end the motion.
    assert motion.wait(INF).outcome == "finished"
    assert motion.wait(-1).outcome == "finished"


def test_a_plan_leaves_its_margin():
    places = [[1.2, 0.4, -0.9, 0.8, 0.6, 1.0], [-1.2, -0.5, 0.9, -0.8, -0.6, -1.0]]
    default, none = openjtc.Planner().through(places), openjtc.Planner(margin=0).through(places)
    assert default.check.margin["percent"] >= 15 and not default.check.warnings
    assert none.check.margin["percent"] < 10 and "torque margin" in none.check.warnings[0]
    assert openjtc.Planner().check(none).margin == none.check.margin


def test_no_number_panics(robot):
    odd = [NAN, INF, -INF, 0.0, -1.0, 1e300, 2**70]
    acts = [
        lambda x: robot.jog(x, 0.1, joint=1),
        lambda x: robot.jog(0.1, x, joint=1),
        lambda x: robot.move([x] * 6),
        lambda x: robot.move(flange=[x] * 6),
        lambda x: robot.move(HOME, speed=x),
        lambda x: robot.plan([HOME, [x] * 6]),
        lambda x: robot.plan([HOME, HOME + 0.1], margin=x),
        lambda x: robot.plan([HOME, HOME + 0.1], times=[0, x]),
        lambda x: robot.plan([HOME, HOME + 0.1], blend=x),
        lambda x: robot.wait_ready(x),
        lambda x: robot.push(1, x, x),
        lambda x: setattr(robot, "speed", x),
        lambda x: setattr(robot, "payload", openjtc.Payload(x)),
        lambda x: robot.set_settings({"ramp_ms": x}),
        lambda x: robot.check(openjtc.example("motion"), start=[x] * 6),
        lambda x: openjtc.example("motion").at_speed(x),
        lambda x: openjtc.Planner(temperature=x).to([0] * 6, HOME),
        lambda x: openjtc.Trajectory(10, [[x] * 6] * 3, [[0] * 6] * 3, [[0] * 6] * 3),
        lambda x: openjtc.connect("sim:", speed=x or 2.0).close(),
    ]
    for act in acts:
        for number in odd:
            try:
                act(number)
            except Exception as error:
                # A panic would not be one of these exceptions.
                assert isinstance(error, (openjtc.Error, OverflowError)), repr(error)
            # A push may have brought the controller into Error.
            if robot.status.state == "Error":
                robot.recover()


def test_errors_say_where_and_by_how_much(robot):
    with pytest.raises(openjtc.UsageError) as caught:
        robot.move([0, 0, NAN, 0, 0, 0])
    assert caught.value.joint == 3 and np.isnan(caught.value.value)
    outside = openjtc.Trajectory(100, [[0, 3.0, 0, 0, 0, 0]] * 3, np.zeros((3, 6)), np.zeros((3, 6)))
    with pytest.raises(openjtc.RefusedError) as caught:
        robot.check(outside, start=[0, 3.0, 0, 0, 0, 0]).raise_if_refused()
    error = caught.value
    assert (error.joint, error.point) == (2, 0) and error.limit == pytest.approx(1.57)
    assert error.value == pytest.approx(3.0, abs=1e-3)


def test_what_helps_is_something_that_a_program_can_do(robot):
    robot.push(2, 390, 2.0)
    while robot.status.state != "Error":
        pass
    with pytest.raises(openjtc.Error) as caught:
        robot.move(HOME)
    assert "robot.recover()" in caught.value.next and "jtc recover" not in caught.value.next
    assert "robot.recover()" in robot.status.next
    robot.recover()


def test_settings_are_changed_whole_and_take_arrays(robot):
    robot.disable()
    with pytest.raises(openjtc.UsageError, match=r"\(5,\)"):
        robot.set_settings({"velocity_max_rad_s": [1.0] * 5})
    before = robot.settings
    for wrong in ({"velocity_max_rad_s": np.array([1.0, 1, 1, 1, 1, 99.0])}, {"ramp_ms": 250, "gripper": 7}):
        with pytest.raises(openjtc.Error):
            robot.set_settings(wrong)
        assert robot.settings == before
    with pytest.raises(openjtc.UsageError) as caught:
        robot.set_settings({"velocity_max_rad_s": [1.0, 1, 1, 1, 1, 99.0]})
    assert (caught.value.joint, caught.value.value, caught.value.limit) == (6, 99.0, 20.0)
    robot.set_settings({"velocity_max_rad_s": np.full(6, 1.25), "ramp_ms": np.float32(300)})
    assert robot.settings["velocity_max_rad_s"] == [1.25] * 6 and robot.settings["ramp_ms"] == 300


def test_another_arm_than_the_one_that_was_named_is_neither_moved_nor_let_go(tmp_path: Path):
    arm = openjtc.Arm.avena()
    with openjtc.connect("sim:", arm=arm, speed=None) as robot:
        robot.disable()
        robot.set_settings({"velocity_max_rad_s": [1.25] * 6})
        robot.use_defaults()
        robot.wait_ready()
        # The controller's arm can be read, but motions must be refused.
        assert robot.arm.limits["velocity_max"] == pytest.approx(1.25)
        refused = (lambda: robot.move(HOME), lambda: robot.jog(0.1, 0.2, joint=1), lambda: robot.teach().__enter__(), robot.resume)
        for act in refused:
            with pytest.raises(openjtc.RefusedError) as caught:
                act()
            assert caught.value.code == "other-arm" and "velocity_max_rad_s" in caught.value.message
        assert robot.status.state == "HoldPos"
        robot.disable()
        robot.push_arm(arm)
        robot.wait_ready()
        assert robot.move(HOME).outcome == "finished"


def test_recover_checks_the_arm_that_it_gives(tmp_path: Path):
    text = openjtc.Arm.avena().to_toml()
    slow, shaky = tmp_path / "slow.toml", tmp_path / "shaky.toml"
    slow.write_text(re.sub(r"velocity_max_rad_s = [0-9.]+", "velocity_max_rad_s = 0.5", text, count=1))
    shaky.write_text(re.sub(r"kd = [0-9.]+", "kd = 9000.0", text, count=1))
    with openjtc.connect("sim:", speed=None) as robot:
        robot.disable()
        for file, code in ((slow, "device-limits"), (shaky, "unstable-gains")):
            with pytest.raises(openjtc.RefusedError) as caught:
                robot.recover(arm=openjtc.Arm.load(file))
            assert caught.value.code == code, caught.value
            assert robot.status.state != "HoldPos"
        steps = robot.recover(arm=openjtc.Arm.load(slow), accept_device_limits=True)
        assert steps[0].startswith("warning: ") and robot.status.state == "HoldPos"


def test_a_speed_override_acts_and_is_noted():
    with openjtc.connect("sim:", speed=None) as robot:
        way = robot.plan([robot.position, HOME])
        robot.speed = 0.5
        assert robot.speed == 0.5
        slow = robot.run(way)
        back = robot.plan([robot.position, [0] * 6])
        robot.speed = 1.0
        fast = robot.run(back)
        assert slow.duration > 1.7 * way.duration and fast.duration < 1.3 * back.duration
        assert any("0.5 of its speed" in note for note in slow.notes) and fast.notes == back.notes


def test_what_a_silent_joint_measures_is_not_known(robot):
    now = robot.info["uptime"]
    robot.inject(f'format = 2\n[[fault]]\nkind = "node-silent"\njoint = 3\nat_s = {now + 0.5}\n')
    while robot.status.state != "Error":
        pass
    # The drive is lost before the controller has received its first answer, so the joint was never measured.
    with pytest.raises(openjtc.Error):
        robot.recover()
    status = robot.status
    assert np.isnan(status.position[2]) and np.isnan(status.temperature[2]) and np.isfinite(status.position[1])
    with pytest.raises(openjtc.DeviceError) as caught:
        robot.check(openjtc.example("motion"))
    assert caught.value.joint == 3


def test_columns_are_of_the_type_that_they_are_declared_with(robot):
    run = robot.move(HOME)
    assert {values.dtype for values in run.arrays().values()} == {np.dtype(np.float64)}


def test_a_recording_is_replaced_only_by_a_whole_one(robot, tmp_path: Path):
    file = tmp_path / "run.csv"
    file.write_text("mine")
    with pytest.raises(openjtc.RefusedError):
        robot.move([4, 0, 0, 0, 0, 0], record=file, overwrite=True)
    assert file.read_text() == "mine" and os.listdir(tmp_path) == ["run.csv"]
    assert not any("recording" in note for note in robot.move(HOME, record=file, overwrite=True).notes)
    assert file.read_text() != "mine" and os.listdir(tmp_path) == ["run.csv"]


def test_a_fault_between_two_motions_is_part_of_the_run_and_of_its_recording(tmp_path: Path):
    with openjtc.connect("sim:", speed=5.0) as robot:
        way = robot.plan([HOME, HOME + [0.5, 0, 0, 0, 0, 0]])
        motion = robot.start(way, approach=True, repeat=3, record=tmp_path / "run.csv")
        while motion.progress[0] != "motion":
            pass
        robot.push(1, 390, 3.0)
        with pytest.raises(openjtc.Error) as caught:
            motion.wait(60)
        assert caught.value.run is not None and len(caught.value.run) > 50
        assert "# " in (tmp_path / "run.csv").read_text()[-600:]
