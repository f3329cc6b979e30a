"""Tests of a connection to a simulated controller: motions, refusals, stops and results."""

from __future__ import annotations

import asyncio
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import openjtc
import pytest
from robot_agent import agent

HOME = np.array([0.0, 0.5, -1.0, 0.0, 0.5, 0.0])
#: Largest distance of a held arm from its target, rad.
NEAR = 5e-3


@pytest.fixture
def robot():
    with openjtc.connect("sim:", speed=None) as robot:
        yield robot


@pytest.fixture
def live():
    """Yields a robot whose simulated time runs ten times faster than real time."""
    with openjtc.connect("sim:", speed=10.0) as robot:
        yield robot


def until(true, seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.005)


def test_four_lines_move_an_arm():
    with openjtc.connect("sim:", speed=None) as robot:
        run = robot.move([0, 30, -60, 0, 30, 0], degrees=True)
        assert run.outcome == "finished"
        assert robot.position == pytest.approx(np.radians([0, 30, -60, 0, 30, 0]), abs=NEAR)


def test_a_run_has_figures_arrays_tables_and_reports(robot, tmp_path: Path):
    run = robot.run(openjtc.example("motion"), approach=True, record=tmp_path / "run.mcap")
    a = run.arrays()
    n = len(run)
    assert a["time"].shape == (n,) and a["position"].shape == a["torque"].shape == (n, 6)
    assert np.all(np.diff(a["time"]) > 0)
    # The figures must agree with the samples.
    operating = np.array([state == "Operate" for state in run._native.states])
    rms = 1e3 * np.sqrt(np.mean(a["error"][operating] ** 2, axis=0))
    assert [joint.rms_error_mrad for joint in run.joints] == pytest.approx(rms, rel=0.05)
    assert run.duration == pytest.approx(openjtc.example("motion").duration, abs=0.3)
    # The parts of the torque must add up to the torque.
    parts = sum(a[f"torque_{part}"] for part in ("model", "p", "i", "d", "friction"))
    assert np.abs(parts - a["torque"])[operating].max() < 1.0
    page = run.report(tmp_path / "run.html").read_text(encoding="utf-8")
    assert page.lower().startswith("<!doctype html") and "srcdoc" in run._repr_html_()
    with pytest.raises(openjtc.UsageError, match="exists"):
        run.report(tmp_path / "run.html")
    assert (tmp_path / "run.mcap").read_bytes().startswith(b"\x89MCAP0\r\n")
    run.save(tmp_path / "run.csv")
    again = openjtc.Trajectory.load(tmp_path / "run.csv")
    assert again.duration == pytest.approx(run.duration, abs=0.3)
    assert str(run).count("\n") == 7


def test_a_run_becomes_tables_of_pandas_and_polars(robot):
    run = robot.move(HOME)
    pandas = pytest.importorskip("pandas")
    frame = run.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and len(frame) == len(run)
    assert frame["position_2"].iloc[-1] == pytest.approx(HOME[1], abs=NEAR)
    polars = pytest.importorskip("polars")
    assert isinstance(run.to_polars(), polars.DataFrame)


def test_a_run_is_plotted(robot):
    pytest.importorskip("matplotlib")
    figure = robot.move(HOME).plot()
    assert len(figure.axes) == 2 and len(figure.axes[0].lines) == 12


def test_the_same_seed_gives_the_same_bits():
    def motion(seed: int) -> np.ndarray:
        with openjtc.connect("sim:", speed=None, seed=seed) as robot:
            return robot.move(HOME).arrays()["position"]

    assert np.array_equal(motion(3), motion(3))


def test_what_is_refused_has_its_facts_and_moves_nothing(robot):
    before = robot.position
    with pytest.raises(openjtc.RefusedError) as caught:
        robot.move([4, 0, 0, 0, 0, 0])
    error = caught.value
    assert (error.code, error.joint, error.value) == ("plan", 1, 4.0)
    assert error.limit == pytest.approx(robot.arm.limits["position_max"][0])
    assert error.cause and error.next and "joint 1" in error.message
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.joint, again.limit) == (str(error), error.joint, error.limit)
    # A trajectory with another start position must be refused.
    with pytest.raises(openjtc.RefusedError) as caught:
        robot.run(robot.plan([HOME, HOME + 0.2]))
    assert caught.value.joint is not None and "approach=True" in caught.value.next
    assert robot.position == pytest.approx(before, abs=1e-4)
    for wrong in ([1, 2, 3], "nowhere", [0, 0, np.nan, 0, 0, 0]):
        with pytest.raises(openjtc.Error):
            robot.move(wrong)
    with pytest.raises(openjtc.UsageError):
        robot.move()
    with pytest.raises(openjtc.Error):
        robot.move(HOME, speed=101)


def test_a_recording_that_is_there_is_not_written_over(robot, tmp_path: Path):
    file = tmp_path / "run.csv"
    file.write_text("mine")
    with pytest.raises(openjtc.UsageError, match="nothing was sent"):
        robot.move(HOME, record=file)
    assert file.read_text() == "mine"
    # A refused motion must leave no file.
    with pytest.raises(openjtc.RefusedError):
        robot.move([4, 0, 0, 0, 0, 0], record=tmp_path / "none.csv")
    assert not (tmp_path / "none.csv").exists()


def test_a_move_without_a_speed_is_slow_and_says_so(robot):
    """Covers joint positions, a pose of the flange and approaches, with and without a speed."""
    told = "at 25 % of the limits; `speed=` sets it"
    way = robot.plan([[0] * 6, HOME])
    slow = robot.move(HOME)
    assert f"move {told}" in slow.notes
    robot.move([0] * 6, speed=100)
    same = robot.move(HOME, speed=25)
    # The run has an approach of 0.2 s, or no approach if the arm is exactly at the first point.
    assert same.duration == pytest.approx(slow.duration, abs=0.25) and not same.notes
    robot.move([0] * 6, speed=100)
    assert slow.duration > 1.7 * robot.move(HOME, speed=100).duration
    assert f"move {told}" in robot.move(flange=[0.6, -0.3, 0.4, 0, 0, 0]).notes
    approached = robot.run(way, approach=True)
    assert f"approach {told}" in approached.notes
    assert approached.duration == pytest.approx(way.duration, abs=0.3)
    robot.move(HOME + 0.1, speed=100)
    assert not robot.run(way, approach=True, speed=100).notes
    assert not robot.run(robot.plan([HOME, [0] * 6])).notes
    # Several approaches must give a single note.
    assert robot.run(robot.plan([robot.position, HOME]), approach=True, repeat=3).notes.count(f"approach {told}") == 1


@pytest.mark.parametrize(
    ("length", "blend"), [(60, 5), (60, 10), (30, 5), (30, 1), (90, 20), (45, 28), (10, 3), (80, 0.5), (57, 2), (60, 0)]
)
def test_a_blend_is_in_the_unit_of_the_waypoints(robot, length: float, blend: float):
    corner = np.array([[0] * 6, [length, 0, 0, 0, 0, 0], [length, length / 2, 0, 0, 0, 0]])
    listed = [{f"q{j}": q for j, q in enumerate(place, 1)} for place in corner]
    reference = robot.plan(np.radians(corner), blend=np.radians(blend))
    planner = openjtc.Planner(robot.arm)
    for plan in (
        robot.plan(corner, blend=blend, degrees=True),
        planner.through(corner, blend=blend, degrees=True),
        planner.through(np.radians(corner), blend=np.radians(blend)),
        openjtc.Planner(robot.arm, blend=np.radians(blend)).through(corner, degrees=True),
        robot.plan(listed, blend=blend, degrees=True),
    ):
        assert plan.trajectory.position == pytest.approx(reference.trajectory.position, abs=1e-6)
    missed = np.abs(reference.trajectory.position - np.radians(corner[1])).max(axis=1).min()
    assert missed <= np.radians(blend) + 0.01
    assert any("waypoint 2 is missed by" in note for note in reference.notes) == (missed > 0.05)


@pytest.mark.parametrize("blend", [0.51, 0.6, 1, 2, 5, 10, 30, 90, 300, 1e9])
def test_a_blend_in_degrees_is_refused_where_rad_are_meant(robot, blend: float):
    corner = [[0] * 6, [1, 0, 0, 0, 0, 0], [1, 0.5, 0, 0, 0, 0]]
    for plan in (
        lambda: robot.plan(corner, blend=blend),
        lambda: openjtc.Planner(blend=blend).through(corner),
        lambda: openjtc.Planner().through(corner, blend=blend),
        lambda: openjtc.Planner(blend=blend).through(np.degrees(corner), degrees=True),
        lambda: robot.plan(np.degrees(corner), blend=np.degrees(blend), degrees=True),
        lambda: robot.plan([{f"q{j}": q for j, q in enumerate(place, 1)} for place in corner], blend=blend),
    ):
        with pytest.raises(openjtc.UsageError, match="out of range, expected 0..0.5 rad") as caught:
            plan()
        assert caught.value.limit == 0.5 and "degrees=True" in caught.value.next
        assert caught.value.value >= 0.51


def test_a_run_in_which_joints_stand_still_is_small_in_a_notebook(robot):
    run = robot.move([0, 30, 0, 0, 0, 0], degrees=True)
    # A notebook requests every representation of an object, and shows one of them.
    forms = [form for form in ("html", "svg", "png", "jpeg", "pdf", "markdown") if hasattr(run, f"_repr_{form}_")]
    assert forms == ["html"] and len(run._repr_html_()) < 2_000_000


@pytest.mark.parametrize(
    ("package", "act"),
    [("matplotlib", "plot"), ("pandas", "to_pandas"), ("polars", "to_polars")],
)
def test_what_an_optional_package_is_needed_for_says_how_to_install_it(robot, package: str, act: str, monkeypatch):
    plan = robot.plan([[0] * 6, HOME])
    # Simulates that the package is not installed.
    for module in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, module)

    class Missing:
        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] == package:
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(sys, "meta_path", [Missing(), *sys.meta_path])
    with pytest.raises(ImportError, match=f"pip install {package}$"):
        getattr(plan, act)()


def test_plans_keep_the_limits_and_run(robot):
    waypoints = [HOME, HOME + 0.3, HOME - [0.4, 0.1, 0, 0, 0.2, 0]]
    plan = robot.plan(waypoints, blend=0.05)
    assert plan.check and plan.duration == pytest.approx(plan.waypoint_times[-1])
    limits, t = robot.arm.limits, plan.trajectory
    assert np.all(np.abs(t.velocity) <= limits["velocity_max"] * 1.001)
    assert np.all(t.position >= limits["position_min"]) and np.all(t.position <= limits["position_max"])
    assert plan.binding and all(1 <= bound["joint"] <= 6 for bound in plan.binding)
    assert robot.run(plan, approach=True).outcome == "finished"
    assert robot.position == pytest.approx(waypoints[-1], abs=NEAR)
    slower = robot.plan(waypoints, blend=0.05, speed=50)
    assert slower.duration > 1.2 * plan.duration
    timed = openjtc.Planner(robot.arm).through(waypoints, times=[0, 5, 9])
    assert timed.duration == pytest.approx(9, abs=0.02)


def test_waypoints_are_arrays_files_and_lists(robot, tmp_path: Path):
    file = tmp_path / "w.csv"
    file.write_text("q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.5,0.2,-0.4,0,0.3,0\n")
    by_file = robot.plan(file).trajectory
    by_array = robot.plan([[0] * 6, [0.5, 0.2, -0.4, 0, 0.3, 0]]).trajectory
    rows = [dict(zip([f"q{j}" for j in range(1, 7)], row)) for row in ([0] * 6, [0.5, 0.2, -0.4, 0, 0.3, 0])]
    assert np.array_equal(by_file.position, by_array.position)
    assert np.array_equal(by_file.position, robot.plan(rows).trajectory.position)
    with pytest.raises(openjtc.Error):
        robot.plan([{"q1": 1}])
    with pytest.raises(openjtc.Error):
        robot.plan([[0] * 6, [0] * 6])


def test_the_flange_goes_straight(robot):
    from openjtc.dynamics import Dynamics

    robot.move(HOME)
    dynamics = Dynamics(robot.arm)
    start = dynamics.forward_kinematics(robot.position)[:3, 3]
    pose = dynamics.forward_kinematics(robot.position)
    goal = start + [0.05, 0.1, -0.05]
    r = pose[:3, :3]
    rpy = [np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])]
    run = robot.move(flange=[*goal, *rpy], line=True)
    path = dynamics.forward_kinematics(run.arrays()["set_position"][::20])
    way = path[~np.isnan(path[:, 0, 3])][:, :3, 3] - start
    along = (goal - start) / np.linalg.norm(goal - start)
    aside = np.linalg.norm(way - np.outer(way @ along, along), axis=1)
    assert aside.max() < 1e-3
    assert dynamics.forward_kinematics(robot.position)[:3, 3] == pytest.approx(goal, abs=3e-3)


def test_a_motion_is_paused_slowed_resumed_and_stopped_from_another_thread(live):
    motion = live.start(openjtc.example("motion"), approach=True)
    until(lambda: motion.progress[0] == "motion" and motion.progress[1] > 0.2)
    live.pause()
    until(lambda: live.status.trajectory == "Pause")
    held = live.position
    time.sleep(0.1)
    assert live.position == pytest.approx(held, abs=1e-3) and not motion.is_done
    with pytest.raises(TimeoutError):
        motion.wait(0.05)
    live.speed = 0.5
    live.resume()
    until(lambda: live.status.trajectory == "Execute")
    live.stop()
    run = motion.wait(30)
    assert run.outcome == "stopped" and 0 < run.duration < 6
    assert np.abs(live.status.velocity).max() < 0.01
    live.speed = 1.0
    assert live.speed == 1.0


def test_a_status_comes_and_a_pause_counts_while_a_motion_is_uploaded(live):
    motion = live.start(openjtc.example("motion"), approach=False, speed=50)
    until(lambda: motion.progress[0] == "upload")
    assert live.status.state == "HoldPos" and motion.progress[0] == "upload"
    live.pause()
    until(lambda: live.status.trajectory == "Pause")
    assert motion.progress[1] < 0.5 and not motion.is_done
    live.stop()
    assert motion.wait(30).outcome == "stopped"


def test_a_stop_is_the_end_of_all_that_was_asked_for_before(live):
    first = live.start(openjtc.example("motion"), approach=True)
    second = live.start(openjtc.example("motion"), approach=True)
    until(lambda: first.progress[0] == "motion")
    live.stop()
    assert first.wait(30).outcome == "stopped"
    with pytest.raises(openjtc.FaultError, match="cancelled"):
        second.wait(30)
    # A later request must be executed.
    assert live.move(HOME).outcome == "finished"


def test_asyncio_awaits_a_run_and_a_cancelled_task_stops_the_arm(live):
    async def main() -> None:
        assert (await live.run_async(live.plan([live.position, HOME]))).outcome == "finished"
        task = asyncio.create_task(live.run_async(openjtc.example("motion"), approach=True))
        while live.status.state != "Operate":
            await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(main())
    assert np.abs(live.status.velocity).max() < 0.01
    assert live.status.trajectory in ("Stop", "Null")


def test_ctrl_c_stops_the_arm_before_it_is_raised(live):
    def press() -> None:
        until(lambda: live.status.state == "Operate" and live.status.point > 300)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        live.run(openjtc.example("motion"), approach=True)
    thread.join()
    status = live.status
    assert status.trajectory == "Stop" and np.abs(status.velocity).max() < 0.01


def test_the_end_of_a_context_and_of_a_program_stops_what_moves(tmp_path: Path):
    with openjtc.connect("sim:", speed=10.0) as robot:
        motion = robot.start(openjtc.example("motion"), approach=True)
        until(lambda: motion.progress[0] == "motion")
    assert robot.is_closed and motion.wait().outcome == "stopped"
    with pytest.raises(openjtc.NoLinkError, match="closed"):
        robot.move(HOME)
    robot.close()
    # The test also checks this without a context manager.
    program = (
        "import openjtc\n"
        "robot = openjtc.connect('sim:', speed=10.0)\n"
        "motion = robot.start(openjtc.example('motion'), approach=True, record='run.csv')\n"
        "while motion.progress[0] != 'motion': pass\n"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True, timeout=60)
    assert "stopped" in (tmp_path / "run.csv").read_text()[-400:]


def test_an_arm_is_jogged_and_rests(robot):
    before = robot.position
    after = robot.jog(0.1, 1.0, joint=3)
    moved = after - before
    assert moved[2] == pytest.approx(0.1, abs=0.02) and np.abs(np.delete(moved, 2)).max() < NEAR
    with pytest.raises(openjtc.Error):
        robot.jog(50.0, 1.0, joint=3)
    with pytest.raises(openjtc.UsageError):
        robot.jog(0.1, 1.0, joint=7)


def test_an_arm_is_taught_and_replays(robot):
    robot.move(HOME)
    path = robot.plan([HOME, HOME + [0.4, 0.1, 0, 0.2, 0, 0], HOME])
    with robot.teach() as teaching:
        robot.lead(path)
        teaching.record(path.duration + 2.0)
    assert robot.status.state == "HoldPos"
    assert len(teaching.time) == len(teaching.position) > 20 and np.all(np.diff(teaching.time) > 0)
    assert teaching.position[:, 0].max() == pytest.approx(0.4, abs=0.05)
    waypoints = teaching.waypoints(0.01)
    assert 3 <= len(waypoints) < len(teaching.time)
    assert robot.run(robot.plan(waypoints, blend=0.02), approach=True).outcome == "finished"


def test_a_payload_comes_into_the_torques(robot):
    robot.move(HOME)
    without = robot.check(robot.plan([HOME, HOME + 0.1])).joints
    robot.payload = openjtc.Payload(2.0, (0, 0, 0.08))
    assert robot.payload.mass == 2.0 and robot.payload.com[2] == pytest.approx(0.08)
    loaded = robot.check(robot.plan([HOME, HOME + 0.1])).joints
    assert loaded[1]["torque_peak_nm"] != without[1]["torque_peak_nm"]
    with pytest.raises(openjtc.Error):
        robot.payload = openjtc.Payload(-1.0)
    assert robot.payload.mass == 2.0
    robot.payload = None
    assert robot.payload.mass == 0.0


def test_a_fault_is_an_error_with_what_was_seen_and_found_in_the_flight_recorder(robot, tmp_path: Path):
    robot.move(HOME)
    now = robot.info["uptime"]
    robot.inject(f'format = 2\n[[fault]]\nkind = "node-silent"\njoint = 3\nat_s = {now + 5.0}\n')
    with pytest.raises(openjtc.Error) as caught:
        for _ in range(20):
            robot.move(HOME + [0.3, 0, 0, 0, 0, 0])
            robot.move(HOME)
    assert "joint 3" in str(caught.value) or caught.value.joint == 3
    status = robot.status
    assert status.state == "Error" and any("joint 3" in error for error in status.errors) and status.next
    log = robot.flight_log()
    ticks, same = log.replayed
    assert ticks > 1000 and same > 0 and "joint 3" in log.story[0]
    assert log.to_pandas().shape[0] == ticks if _has("pandas") else True
    log.save(tmp_path / "fault.mcap")
    assert (tmp_path / "fault.mcap").stat().st_size > 10_000


def _has(module: str) -> bool:
    import importlib.util

    return importlib.util.find_spec(module) is not None


def test_a_controller_recovers_and_says_how(robot):
    robot.move(HOME)
    robot.push(2, 390, 2.0)
    until(lambda: robot.status.state == "Error")
    with pytest.raises(openjtc.Error):
        robot.move(HOME + 0.1)
    steps = robot.recover()
    assert steps[-1].startswith("HoldPos")
    assert robot.move(HOME).outcome == "finished"
    assert all(found.severity == "good" for found in robot.doctor())


def test_a_held_stop_says_what_was_found(robot):
    """J-69: status, info, doctor and error contain joint, value and limit of the push."""
    robot.move(HOME)
    robot.push(5, 38, 0.5)
    until(lambda: robot.status.held_stop is not None)
    status = robot.status
    stop = status.held_stop
    assert (stop.kind, stop.joint, stop.unit) == ("push", 5, "N·m")
    assert stop.limit == pytest.approx(0.3 * 40, abs=1e-3) and abs(stop.value) > stop.limit
    assert stop.text.startswith("joint 5 was pushed") and stop.remedy in status.next and 0 <= stop.ago_s < 600
    assert robot.info["reactions"]["last_held_stop"]["text"] == stop.text
    assert stop.text in robot.doctor()[0].what
    with pytest.raises(openjtc.HeldStopError) as caught:
        robot.move(HOME + 0.1)
    error = caught.value
    assert (error.kind, error.joint, error.unit, error.text) == ("push", 5, "N·m", stop.text)
    assert error.value == pytest.approx(stop.value) and error.limit == pytest.approx(stop.limit)
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), again.kind, again.text, str(again)) == (type(error), error.kind, error.text, str(error))
    robot.recover()
    assert robot.status.held_stop is None and robot.info["reactions"]["encoder_jumped"] == []


def test_an_arm_is_pushed_while_it_moves(live):
    motion = live.start(openjtc.example("motion"), approach=True)
    until(lambda: motion.progress[0] == "motion" and motion.progress[1] > 0.3)
    live.push(1, 390, 2.0)
    with pytest.raises(openjtc.Error) as caught:
        motion.wait(60)
    assert caught.value.joint == 1 and caught.value.run.outcome == "fault" and len(caught.value.run) > 100
    assert "joint 1" in caught.value.run.failure


def test_settings_info_and_arm_are_those_of_the_controller(robot):
    settings = robot.settings
    assert len(settings["position_max_rad"]) == 6
    assert settings["position_max_rad"] == pytest.approx(robot.arm.limits["position_max"].tolist())
    assert robot.info["board"] == "simulator" and robot.info["firmware"] == openjtc.__version__
    with pytest.raises(openjtc.UsageError, match="does not exist"):
        robot.set_settings({"no_such": 1.0})
    # Settings can change only while the drives have no torque.
    with pytest.raises(openjtc.Error, match="not allowed"):
        robot.set_settings({"ramp_ms": 300})


def test_another_arm_than_the_one_that_was_named_is_not_moved(tmp_path: Path):
    other = openjtc.Arm.parse(openjtc.Arm.avena().to_toml().replace("name = \"avena\"", "name = \"other\""))
    with openjtc.connect("sim:", arm=other, speed=None) as robot:
        assert robot.arm.name == "other"
        assert robot.move(HOME).outcome == "finished"


@pytest.mark.skipif("OPENJTC_ROBOTS" not in os.environ, reason="OPENJTC_ROBOTS names no folder of robot descriptions")
def test_a_robot_description_plans_and_runs(monkeypatch: pytest.MonkeyPatch):
    """Imports the URDF of a third-party UR5, plans a motion and runs it."""
    monkeypatch.syspath_prepend(Path(__file__).parents[3] / "references" / "arms")
    import descriptions

    arm = openjtc.Arm.import_urdf(descriptions.folder() / "ur_description/urdf/ur5_robot.urdf", tip="ee_link")
    assert arm.warnings, "what a description lacks is reported"
    with openjtc.connect("sim:", arm=arm, speed=None) as robot:
        start = robot.position
        plan = robot.plan([start, start + [0.4, -0.3, 0.5, 0.2, 0.3, 0.6], start], blend=0.05)
        run = robot.run(plan)
        assert run.outcome == "finished"
        assert max(joint.max_error_mrad for joint in run.joints) < 50
        assert np.abs(run.arrays()["position"][-1] - start).max() < 0.01


def test_there_is_no_such_port_or_agent():
    with pytest.raises(openjtc.NoLinkError) as caught:
        openjtc.connect("/dev/ttyUSB77")
    assert caught.value.next and isinstance(caught.value, ConnectionError)
    with pytest.raises(openjtc.NoLinkError):
        openjtc.connect("http://127.0.0.1:9")
    with pytest.raises(openjtc.UsageError):
        openjtc.connect("sim:fast")


@pytest.mark.skipif("JTC" not in os.environ, reason="the environment names no program jtc")
def test_the_same_lines_over_a_serial_port_and_through_an_agent(tmp_path: Path):
    """The test runs ``jtc sim`` at a pseudo-terminal and ``jtc serve``, in separate processes."""
    jtc = os.environ["JTC"]
    env = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path), "HOME": str(tmp_path)}
    port = tmp_path / "port"
    with subprocess.Popen([jtc, "sim", "--serial", port], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env) as sim:
        try:
            assert b"ready" in sim.stdout.readline()
            with openjtc.connect(str(port)) as robot:
                robot.use_defaults()
                robot.wait_ready()
                assert robot.move([0.1, 0.2, -0.4, 0, 0.2, 0]).outcome == "finished"
        finally:
            sim.terminate()
    with agent(tmp_path) as (url, operator):
        with openjtc.connect(url, token=operator, name="test") as robot:
            if robot.status.state == "Init":
                robot.use_defaults()
            robot.wait_ready()
            run = robot.move([0.1, 0.2, -0.4, 0, 0.2, 0])
            assert run.outcome == "finished" and len(run) > 5
        # The agent must refuse an unknown token.
        with pytest.raises(openjtc.RefusedError, match="denies access to this program"):
            openjtc.connect(url, token="x" * 30)
