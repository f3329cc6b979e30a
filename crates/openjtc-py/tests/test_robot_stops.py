"""Tests of everything that stops an arm: Stop, Ctrl-C, the end of a ``with`` block, the end of a wait for a motion, and the end of the
program."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tty
import urllib.request
from pathlib import Path

import numpy as np
import openjtc
import openjtc.motion
import pytest
from openjtc.control import encode
from openjtc.sim import Simulator
from robot_agent import agent

HOME = np.array([0.0, 0.5, -1.0, 0.0, 0.5, 0.0])
needs_jtc = pytest.mark.skipif("JTC" not in os.environ, reason="the environment names no program jtc")


@pytest.fixture
def live():
    """Yields a robot whose simulated time runs five times faster than real time."""
    with openjtc.connect("sim:", speed=5.0) as robot:
        yield robot


@pytest.fixture
def port(tmp_path: Path):
    """Yields a simulated controller at a pseudo-terminal. The simulator runs in a separate process, so that it continues after the end of a
    program."""
    path = tmp_path / "port"
    env = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path), "HOME": str(tmp_path)}
    serial = [os.environ["JTC"], "sim", "--serial", path]
    with subprocess.Popen(serial, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env) as sim:
        try:
            assert b"ready" in sim.stdout.readline()
            with openjtc.connect(str(path)) as robot:
                robot.use_defaults()
                robot.wait_ready()
            yield str(path)
        finally:
            sim.terminate()


class Wire:
    """Simulated controller at a pseudo-terminal. The test reads the bytes of the controller and can suppress them."""

    def __init__(self) -> None:
        self.simulator, self.sent, self.is_silent, self.is_over = Simulator(), b"", False, False
        #: Bytes that simulate another program. The callback gets the bytes that this program sends before the
        #: controller receives them.
        self.to_send, self.on_sent = b"", None
        self.master, self.slave = pty.openpty()
        tty.setraw(self.master)
        self.path = os.ttyname(self.slave)
        os.set_blocking(self.master, False)
        self.thread = threading.Thread(target=self._pass)
        self.thread.start()

    def _pass(self) -> None:
        while not self.is_over:
            with contextlib.suppress(BlockingIOError):
                data = os.read(self.master, 4096)
                self.sent += data
                if self.on_sent is not None:
                    self.on_sent(data)
                self.simulator.write(data)
            if self.to_send:
                self.simulator.write(self.to_send)
                self.to_send = b""
            self.simulator.step(5)
            answer = self.simulator.read()
            if not self.is_silent:
                os.write(self.master, answer)
            time.sleep(0.005)

    def stops(self) -> int:
        return self.sent.count(encode.stop())

    def close(self) -> None:
        self.is_over = True
        self.thread.join()
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def wire():
    wire = Wire()
    try:
        yield wire
    finally:
        wire.close()


def until(true, seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.005)


def is_moving(robot: openjtc.Robot) -> bool:
    status = robot.status
    return status.state == "Operate" and status.point > 200


def stands(robot: openjtc.Robot) -> bool:
    """Returns True if the arm is at rest, the controller holds it, and it stays at its position."""
    status = robot.status
    before, state = status.position, status.state
    time.sleep(0.15)
    after = robot.status
    return state == after.state == "HoldPos" and np.abs(after.position - before).max() < 1e-3


class Aside:
    """Call that runs in a separate thread, with its result and its exception."""

    def __init__(self, act) -> None:
        self.result = self.error = None

        def run() -> None:
            try:
                self.result = act()
            except BaseException as error:
                self.error = error

        self.thread = threading.Thread(target=run)
        self.thread.start()

    def join(self) -> None:
        self.thread.join(30)
        assert not self.thread.is_alive()


def press_when(true) -> Aside:
    def press() -> None:
        until(true)
        os.kill(os.getpid(), signal.SIGINT)

    return Aside(press)


def press_after(seconds: float) -> Aside:
    return Aside(lambda: (time.sleep(seconds), os.kill(os.getpid(), signal.SIGINT)))


# Tests that a Stop discards all earlier requests.


def test_what_waits_for_its_turn_is_not_done_after_a_stop(live, tmp_path: Path):
    away = live.position + [0.3, 0, 0, 0, 0, 0]
    plan = live.plan([live.position, away])
    file = tmp_path / "plan.csv"
    file.write_text(plan.trajectory.to_csv())
    motion = live.start(openjtc.example("motion"), approach=True)
    until(lambda: is_moving(live))
    acts = {
        "run": lambda: live.run(file, approach=True),
        "move": lambda: live.move(np.degrees(away), degrees=True),
        "disable": live.disable,
        "use_defaults": live.use_defaults,
        "gripper": lambda: live.gripper(True),
        "settings": lambda: live.set_settings({"ramp_ms": 300}),
        "jog": lambda: live.jog(0.2, 0.5, joint=1),
        "teach": lambda: live._link.teach(True),
    }
    waiting = {name: Aside(act) for name, act in acts.items()}
    time.sleep(0.3)
    live.stop()
    for name, one in waiting.items():
        one.join()
        assert isinstance(one.error, openjtc.FaultError) and one.error.code == "cancelled", (name, one.error)
    assert motion.wait(30).outcome == "stopped"
    assert stands(live)


def test_a_place_by_its_name_is_not_looked_up_first_and_gone_to_after_a_stop(live):
    arm = openjtc.Arm.parse(openjtc.Arm.avena().to_toml() + '\n[poses]\nup = [0.3, 0.2, -0.4, 0, 0.2, 0]\n')
    with openjtc.connect("sim:", arm=arm, speed=5.0) as robot:
        motion = robot.start(openjtc.example("motion"), approach=True)
        until(lambda: is_moving(robot))
        waiting = Aside(lambda: robot.move("up"))
        time.sleep(0.2)
        motion.stop()
        waiting.join()
        assert isinstance(waiting.error, openjtc.FaultError) and waiting.error.code == "cancelled"
        assert stands(robot)
        # The request was made before the Stop, but begins after the Stop.
        asked = robot._link.asked()
        robot.stop()
        with pytest.raises(openjtc.FaultError, match="cancelled"):
            robot._start(asked, robot.plan([robot.position, robot.position + 0.1])).wait(30)


def test_a_stop_between_the_upload_and_the_execution_counts(live):
    plan = live.plan([live.position, HOME])
    for _ in range(6):
        motion = live.start(plan)
        until(lambda: motion.progress[0] in ("upload", "motion", ""))
        live.stop()
        try:
            assert motion.wait(30).outcome == "stopped"
            plan = live.plan([live.position, HOME])
        except openjtc.FaultError as error:
            assert error.code == "cancelled"
        assert stands(live)


# Tests of Stops by this thread, by other threads and by other programs.


def test_a_stop_ends_the_program_that_waits_for_its_motion(live):
    poses, begun = [HOME, HOME + 0.2, HOME - 0.2, HOME], []

    def cycle() -> None:
        for pose in poses:
            begun.append(pose)
            live.move(pose, speed=30)

    program = Aside(cycle)
    until(lambda: is_moving(live))
    live.stop()
    program.join()
    error = program.error
    assert isinstance(error, openjtc.StoppedError) and error.code == "stopped", error
    assert error.run is not None and error.run.outcome == "stopped" and len(error.run) > 50
    assert len(begun) == 1 and stands(live)


def test_a_motion_that_the_program_stops_itself_is_no_error(live):
    motion = live.start(openjtc.example("motion"), approach=True)
    until(lambda: is_moving(live))
    other = Aside(motion.wait)
    Aside(motion.stop).join()
    assert motion.wait(30).outcome == "stopped"
    other.join()
    assert other.error is None and other.result.outcome == "stopped"
    # This thread stops the arm.
    motion = live.start(openjtc.example("motion"), approach=True)
    until(lambda: is_moving(live))
    live.stop()
    assert motion.wait(30).outcome == "stopped"
    # Another thread stops the arm.
    motion = live.start(openjtc.example("motion"), approach=True)
    until(lambda: is_moving(live))
    Aside(live.stop).join()
    with pytest.raises(openjtc.StoppedError):
        motion.wait(30)


def test_a_stop_acts_whatever_the_connection_is_busy_with(live):
    live.disable()
    live.use_defaults()
    # Several threads wait until the controller holds the arm with all drives enabled.
    waiting = [Aside(lambda: live.wait_ready(30)) for _ in range(3)]
    waiting.append(Aside(live.doctor))
    time.sleep(0.05)
    begin = time.monotonic()
    live.stop()
    assert time.monotonic() - begin < 1.0
    for one in waiting:
        one.join()
        assert isinstance(one.error, openjtc.FaultError) and one.error.code == "cancelled", one.error
    live.wait_ready(60)


def test_a_stop_is_written_first_of_all(wire: Wire):
    with openjtc.connect(wire.path) as robot:
        robot.use_defaults()
        robot.wait_ready()
        assert wire.stops() == 0
        # The Stop must be written before any query, even if the arm is at rest.
        before = len(wire.sent)
        robot.stop()
        assert wire.sent[before:].startswith(encode.stop())
        # The test covers a Stop during another wait, and a Stop on a silent line, which raises an error.
        robot.disable()
        waiting = Aside(lambda: robot.wait_ready(60))
        time.sleep(0.2)
        wire.is_silent, before = True, wire.stops()
        stopping = Aside(robot.stop)
        until(lambda: wire.stops() > before, 1.0)
        stopping.join()
        waiting.join()
        assert isinstance(stopping.error, openjtc.NoLinkError) and "Stop was sent" in stopping.error.message
        wire.is_silent = False


def test_what_a_stop_overtakes_on_its_way_is_not_sent(wire: Wire):
    with openjtc.connect(wire.path) as robot:
        robot.use_defaults()
        robot.wait_ready()
        motion = robot.start(openjtc.example("motion"), approach=True)
        until(lambda: is_moving(robot))
        robot.pause()
        until(lambda: robot.status.trajectory == "Pause")
        executed = wire.sent.count(encode.execute())

        # A resume reads the controller's settings before it sends Execute. The Stop is requested between these two
        # steps.
        def stop(data: bytes) -> None:
            if any(bytes([0x9B, kind]) in data for kind in range(0x40, 0x60)):
                wire.on_sent = None
                robot._link.halt()

        wire.on_sent = stop
        resuming = Aside(robot.resume)
        resuming.join()
        assert isinstance(resuming.error, openjtc.FaultError) and resuming.error.code == "cancelled", resuming.error
        with pytest.raises(openjtc.StoppedError):
            motion.wait(30)
        assert wire.sent.count(encode.execute()) == executed and wire.stops() > 0 and stands(robot)


def test_a_stop_of_somebody_else_ends_all_that_waits_here(wire: Wire):
    with openjtc.connect(wire.path) as robot:
        robot.use_defaults()
        robot.wait_ready()
        motion = robot.start(openjtc.example("motion"), approach=True)
        second = robot.start(openjtc.example("motion"), approach=True)
        until(lambda: is_moving(robot))
        # The Stop arrives like a Stop that an agent forwards from another client.
        wire.to_send = encode.stop()
        with pytest.raises(openjtc.StoppedError) as caught:
            motion.wait(30)
        assert caught.value.run is not None and caught.value.run.outcome == "stopped"
        with pytest.raises(openjtc.FaultError, match="cancelled"):
            second.wait(30)
        executed = wire.sent.count(encode.execute())
        assert stands(robot) and wire.sent.count(encode.execute()) == executed


@pytest.mark.parametrize("busy", ["upload", "flight_log", "jog"])
def test_a_stop_of_another_program_voids_what_waits_however_late_its_turn_comes(
    wire: Wire, busy: str, monkeypatch: pytest.MonkeyPatch
):
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as ends:
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        robot = ends.enter_context(openjtc.connect(wire.path))
        robot.use_defaults()
        robot.wait_ready()
        # The Stop is requested while the connection is busy and further requests wait.
        if busy == "jog":
            Aside(lambda: robot.jog(0.1, 5.0, joint=1))
        elif busy == "flight_log":
            Aside(robot.flight_log)
        waiting = [robot.start(openjtc.example("motion"), approach=True) for _ in range(5)]
        halt_as_another_program(wire.path, folder)
        executed = wire.sent.count(encode.execute())
        # The wait is longer than the hold-off of new requests after a Stop.
        time.sleep(4.0)
        for motion in waiting:
            with pytest.raises(openjtc.FaultError, match=r"cancelled|stopped"):
                motion.wait(30)
        assert stands(robot) and wire.sent.count(encode.execute()) == executed
        # After the hold-off, the connection must execute a new request.
        assert robot.run(openjtc.example("motion"), approach=True).outcome == "finished"


@needs_jtc
def test_a_stop_at_the_agent_voids_what_waits_however_late_its_turn_comes(tmp_path: Path):
    with agent(tmp_path) as (url, operator), openjtc.connect(url, token=operator, name="test") as robot:
        robot.use_defaults()
        robot.wait_ready()
        Aside(lambda: robot.jog(0.1, 5.0, joint=1))
        waiting = [robot.start(openjtc.example("motion"), approach=True) for _ in range(3)]
        time.sleep(1.0)
        stop = urllib.request.Request(f"{url}/api/stop", method="POST")
        with urllib.request.urlopen(stop, timeout=10) as answer:
            assert answer.status == 200
        before = robot.position
        # The wait is longer than the hold-off of new requests after a Stop.
        time.sleep(4.0)
        for motion in waiting:
            with pytest.raises(openjtc.FaultError, match=r"cancelled|stopped"):
                motion.wait(30)
        assert stands(robot) and np.allclose(robot.position, before, atol=0.05)
        assert robot.run(openjtc.example("motion"), approach=True).outcome == "finished"


def halt_as_another_program(port: str, folder: str) -> None:
    """Sends a Stop through the socket of the program that owns the port."""
    name = f"openjtc/line-{os.stat(port).st_rdev:x}.sock"
    with socket.socket(socket.AF_UNIX) as asker:
        asker.settimeout(10.0)
        asker.connect(str(Path(folder) / name))
        asker.sendall(b'{"halt":"stop","by":"a test"}\n')
        assert b'"confirmed":true' in asker.makefile("rb").readline()


def test_an_arm_that_others_move_is_left_alone_by_the_end_of_a_connection(wire: Wire):
    with openjtc.connect(wire.path) as robot:
        robot.use_defaults()
        robot.wait_ready()
        robot.move(robot.position + [0.05, 0, 0, 0, 0, 0])
        stops = wire.stops()
    assert wire.stops() == stops == 0


def test_jogging_that_is_stopped_is_an_error_and_the_arm_rests(live):
    jogging = Aside(lambda: live.jog(0.1, 60.0, joint=1))
    time.sleep(0.6)
    live.stop()
    jogging.join()
    assert isinstance(jogging.error, openjtc.StoppedError), jogging.error
    assert stands(live)


@needs_jtc
def test_a_motion_that_is_resumed_outside_a_run_is_stopped_by_the_end(port: str):
    def paused() -> None:
        # The program ends while its motion is paused, without closing its connection.
        program = (
            "import os, sys, time, openjtc\n"
            "robot = openjtc.connect(sys.argv[1])\n"
            "motion = robot.start(openjtc.example('motion'), approach=True)\n"
            "while robot.status.point < 500 or motion.progress[0] != 'motion': pass\n"
            "robot.pause()\n"
            "while robot.status.trajectory != 'Pause': pass\n"
            "os._exit(0)\n"
        )
        subprocess.run([sys.executable, "-c", program, port], check=True, timeout=60)

    def look() -> None:
        with openjtc.connect(port) as robot:
            assert robot.status.trajectory == "Stop" and stands(robot)

    paused()
    with openjtc.connect(port) as robot:
        assert robot.status.trajectory == "Pause"
        robot.resume()
        until(lambda: robot.status.trajectory == "Execute")
    look()
    paused()
    with pytest.raises(ZeroDivisionError):
        with openjtc.connect(port) as robot:
            robot.resume()
            1 / 0
    look()
    paused()
    with openjtc.connect(port) as robot:
        robot.resume()
        until(lambda: robot.status.trajectory == "Execute")
        pressed = press_after(0.3)
        with pytest.raises(KeyboardInterrupt):
            robot.doctor()
        pressed.join()
        assert robot.status.trajectory == "Stop" and stands(robot)
    # The connection must discard a resume that was requested before a Stop.
    paused()
    with openjtc.connect(port) as robot:
        doctor = Aside(robot.doctor)
        time.sleep(0.2)
        waiting = Aside(robot.resume)
        time.sleep(0.2)
        robot.stop()
        waiting.join()
        doctor.join()
        assert waiting.error is not None and robot.status.trajectory == "Stop" and stands(robot)


# Tests of status and pause directly after the start.


def test_a_status_and_a_pause_right_after_the_start_do_not_wait_for_the_end(live):
    for _ in range(3):
        motion = live.start(openjtc.example("motion"), approach=True)
        begin = time.monotonic()
        assert live.status.state in ("HoldPos", "Operate")
        assert time.monotonic() - begin < 1.0
        live.pause()
        assert not motion.is_done
        until(lambda: live.status.trajectory == "Pause")
        motion.stop()
        assert motion.wait(30).outcome == "stopped"


def test_a_second_motion_waits_and_the_first_is_paused(live):
    motion = live.start(openjtc.example("motion"), approach=True)
    second = live.start(openjtc.example("motion"), approach=True)
    until(lambda: is_moving(live))
    # Each motion must have its own progress.
    assert motion.progress[0] in ("approach", "upload", "motion") and second.progress[0] == "waiting"
    begin = time.monotonic()
    live.speed = 0.5
    assert live.speed == 0.5 and "simulator" in repr(live)
    live.pause()
    assert time.monotonic() - begin < 3.0
    motion.stop()
    assert motion.wait(30).outcome == "stopped" and motion.progress[0] == ""
    with pytest.raises(openjtc.FaultError, match="cancelled"):
        second.wait(30)
    live.speed = 1.0


def test_several_threads_wait_for_a_motion_and_each_gets_it(live):
    motion = live.start(live.plan([live.position, HOME], speed=50))
    waiting = [Aside(motion.wait) for _ in range(3)]
    time.sleep(0.1)
    looked = [motion.is_done for _ in range(20)]
    assert not any(looked)
    for one in waiting:
        one.join()
        assert one.error is None and one.result.outcome == "finished"
    assert motion.is_done and motion.wait().outcome == "finished"


# Tests of Ctrl-C.


class Pressed:
    """Progress bar that raises `KeyboardInterrupt`, or raises an error because it cannot be drawn."""

    disable = False
    error: type[BaseException] = KeyboardInterrupt

    def __init__(self, **_: object) -> None:
        self.n, self.unit, self.looks = 0.0, "", 0

    def __enter__(self) -> Pressed:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def reset(self, **_: object) -> None:
        pass

    def set_description(self, _: str) -> None:
        pass

    def refresh(self) -> None:
        self.looks += 1
        if self.looks > 10:
            raise self.error


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_what_breaks_off_the_bar_stops_the_arm(live, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]):
    monkeypatch.setattr(Pressed, "error", error)
    monkeypatch.setattr(openjtc.motion, "tqdm", Pressed)
    with pytest.raises(error):
        live.run(openjtc.example("motion"), approach=True, progress=True)
    assert live.status.state == "HoldPos" and stands(live)


def test_ctrl_c_with_a_bar_stops_the_arm(live, capsys: pytest.CaptureFixture[str]):
    pressed = press_when(lambda: is_moving(live))
    with pytest.raises(KeyboardInterrupt):
        live.run(openjtc.example("motion"), approach=True, progress=True)
    pressed.join()
    assert live.status.state == "HoldPos" and stands(live)


def test_ctrl_c_in_a_status_and_a_pause_stops_the_arm_and_stays_what_it_is(live):
    motion = live.start(openjtc.example("motion"), approach=True)
    until(lambda: is_moving(live))
    pressed = press_after(0.3)
    with pytest.raises(KeyboardInterrupt):
        while not motion.is_done:
            live.status
    pressed.join()
    assert stands(live) and motion.is_done
    motion = live.start(openjtc.example("motion"), approach=True)
    pressed = press_when(lambda: is_moving(live))
    with pytest.raises(KeyboardInterrupt):
        while not motion.is_done:
            live.speed = 0.9
    pressed.join()
    assert stands(live)
    live.speed = 1.0


def test_what_came_of_a_motion_is_there_after_ctrl_c(live):
    motion = live.start(openjtc.example("motion"), approach=True)
    pressed = press_when(lambda: is_moving(live))
    with pytest.raises(KeyboardInterrupt):
        motion.wait()
    pressed.join()
    run = motion.wait(1)
    assert run.outcome == "stopped" and len(run) > 50


def test_ctrl_c_ends_waiting_for_what_does_not_come(live):
    live.disable()
    pressed = press_after(0.3)
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        live.wait_ready(300)
        time.sleep(1)
    pressed.join()
    assert time.monotonic() - begin < 2.0
    live.use_defaults()
    live.wait_ready(60)


# Tests that teaching is switched off when its context ends.


def test_teaching_ends_with_a_stop_an_error_ctrl_c_and_the_connection(live):
    with pytest.raises(ZeroDivisionError), live.teach():
        assert live.status.state == "Teaching"
        1 / 0
    until(lambda: live.status.state == "HoldPos")
    with live.teach() as teaching:
        stop = Aside(lambda: (time.sleep(0.5), live.stop()))
        teaching.record(100)
        stop.join()
        until(lambda: live.status.state == "HoldPos")
        assert len(teaching.time) > 5
        with pytest.raises(openjtc.FaultError, match="teaching has ended"):
            teaching.record(100)
    with pytest.raises(KeyboardInterrupt), live.teach() as teaching:
        press_after(0.5)
        teaching.record(100)
    assert len(teaching.time) > 5
    until(lambda: live.status.state == "HoldPos")


@needs_jtc
def test_teaching_ends_with_the_connection_and_what_was_asked_before_a_stop_does_not_begin_it(port: str):
    robot = openjtc.connect(port)
    robot._link.teach(True)
    assert robot.status.state == "Teaching"
    robot.close()
    with openjtc.connect(port) as robot:
        until(lambda: robot.status.state == "HoldPos")
        jogging = Aside(lambda: robot.jog(0.05, 20.0, joint=1))
        time.sleep(0.3)
        teaching = Aside(lambda: robot._link.teach(True))
        time.sleep(0.3)
        robot.stop()
        jogging.join()
        teaching.join()
        assert teaching.error is not None
        time.sleep(0.5)
        assert robot.status.state == "HoldPos"


# Tests of the end of programs.


@needs_jtc
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_program_that_is_told_to_end_stops_its_arm(port: str, number: signal.Signals):
    program = (
        "import sys, time, openjtc\n"
        "motion = openjtc.connect(sys.argv[1]).start(openjtc.example('motion'), approach=True)\n"
        "while motion.progress[0] != 'motion' or motion.progress[1] < 0.3: pass\n"
        "print('moves', flush=True)\n"
        "time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program, port], stdout=subprocess.PIPE) as ran:
        assert ran.stdout.readline() == b"moves\n"
        ran.send_signal(number)
        assert ran.wait(20) == 128 + number
    with openjtc.connect(port) as robot:
        assert robot.status.trajectory == "Stop" and stands(robot)


@needs_jtc
def test_a_program_that_keeps_the_motion_alone_stops_it_at_its_end(port: str):
    program = (
        "import gc, sys, openjtc\n"
        "motion = openjtc.connect(sys.argv[1]).start(openjtc.example('motion'), approach=True)\n"
        "gc.collect()\n"
        "while motion.progress[0] != 'motion' or motion.progress[1] < 0.3: pass\n"
    )
    subprocess.run([sys.executable, "-c", program, port], check=True, timeout=60)
    with openjtc.connect(port) as robot:
        assert robot.status.trajectory == "Stop" and stands(robot)


def test_a_child_process_leaves_the_connection_to_its_parent(tmp_path: Path):
    program = (
        "import os, time, openjtc\n"
        "with openjtc.connect('sim:', speed=1.0) as robot:\n"
        "    motion = robot.start(openjtc.example('motion'), approach=True)\n"
        "    while motion.progress[0] != 'motion': pass\n"
        "    child = os.fork()\n"
        "    if child == 0:\n"
        "        assert robot.is_closed\n"
        "        try:\n"
        "            robot.status\n"
        "        except openjtc.NoLinkError as error:\n"
        "            assert 'process' in error.next\n"
        "            raise SystemExit(7)\n"
        "    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7\n"
        "    here, there = os.pipe()\n"
        "    child = os.fork()\n"
        "    if child == 0:\n"
        "        os.write(there, b'x')\n"
        "        time.sleep(30)\n"
        "        os._exit(9)\n"
        # A signal is lost if it arrives while the interpreter forks.
        "    os.read(here, 1)\n"
        "    os.kill(child, 15)\n"
        "    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -15\n"
        "    assert not robot.is_closed and not motion.is_done\n"
    )
    subprocess.run([sys.executable, "-W", "ignore", "-c", program], cwd=tmp_path, check=True, timeout=60)


@needs_jtc
def test_that_the_arm_may_be_moving_is_to_be_seen_in_what_ended_the_block(tmp_path: Path):
    path = tmp_path / "port"
    serial = [os.environ["JTC"], "sim", "--serial", path]
    env = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path), "HOME": str(tmp_path)}
    with subprocess.Popen(serial, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env) as sim:
        try:
            assert b"ready" in sim.stdout.readline()
            has_notes = sys.version_info >= (3, 11)
            warned = contextlib.nullcontext() if has_notes else pytest.warns(RuntimeWarning, match="MAY BE MOVING")
            with pytest.raises(ZeroDivisionError) as caught, warned:
                with openjtc.connect(str(path)) as robot:
                    robot.use_defaults()
                    robot.wait_ready()
                    robot.start(openjtc.example("motion"), approach=True)
                    until(lambda: is_moving(robot))
                    sim.kill()
                    sim.wait()
                    time.sleep(0.2)
                    1 / 0
            if has_notes:
                assert any("MAY BE MOVING" in note for note in caught.value.__notes__), caught.value.__notes__
        finally:
            sim.kill()


# Tests of asyncio.


def test_whatever_ends_a_task_stops_its_arm(live):
    async def main() -> None:
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(live.run_async(openjtc.example("motion"), approach=True), 0.5)
        assert stands(live)
        # The test cancels the task before the task has begun.
        task = asyncio.create_task(live.run_async(openjtc.example("motion"), approach=True))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        await asyncio.sleep(0.2)
        assert stands(live)
        task = asyncio.create_task(live.run_async(openjtc.example("motion"), approach=True))
        while not is_moving(live):
            await asyncio.sleep(0.01)
        live.stop()
        with pytest.raises(openjtc.StoppedError):
            await task
        with pytest.raises(openjtc.UsageError):
            await live.run_async(openjtc.example("motion"), repeat=0)

    asyncio.run(main())


def test_a_closing_connection_takes_no_request_and_every_close_waits_for_its_end():
    """No request may begin after the Stop of ``close``. A second ``close`` must also return only after standstill."""
    robot = openjtc.connect("sim:", speed=1.0)
    motion = robot.start(openjtc.example("motion"), approach=True)
    while motion.progress[0] != "motion":
        time.sleep(0.01)
    closing = threading.Thread(target=robot.close)
    closing.start()
    while not robot.is_closed:
        time.sleep(0.001)
    with pytest.raises(openjtc.NoLinkError) as refused:
        robot.start(openjtc.example("motion"), approach=True)
    assert refused.value.code == "closed"
    # The call of `close` returns only after the thread of the connection has ended, so the other call returns at
    # once.
    robot.close()
    closing.join(timeout=5)
    assert not closing.is_alive()
    with contextlib.suppress(openjtc.StoppedError):
        assert motion.wait().outcome == "stopped"
