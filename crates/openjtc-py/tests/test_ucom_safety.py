"""Tests that the end of a chain and failures leave outputs safe, and that the package reports failures."""

from __future__ import annotations

import _thread
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from ucom_bus import ACTIVE, ADMIN_TO, ALIVE, STOPPED, Bus, bus, numbered, numbered_bus, sim  # noqa: F401  # fixtures

from openjtc import errors, ucom

def test_ctrl_c_and_a_progress_function_that_fails_end_an_update(
    numbered: ucom.SimulatedChain, tmp_path: Path
) -> None:
    image = tmp_path / "image.bin"
    image.write_bytes(bytes(i * i % 251 for i in range(4000)))

    def fails(_: ucom.Progress) -> None:
        raise KeyError("mine")

    with ucom.connect(numbered) as chain:
        with pytest.raises(KeyError, match="mine") as ended:
            chain.update(image, 1, progress=fails)
        outcomes = [event.text for event in chain.events() if event.kind == "updated"]
        assert len(outcomes) == 1 and outcomes[0].startswith("board 1: ")
        if sys.version_info >= (3, 11):
            assert ended.value.__notes__ == outcomes
        timer = threading.Timer(0.9, _thread.interrupt_main)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            while True:
                chain.update(image, 1, progress=False, force=True)
        timer.join()
        assert chain.update(image, 1, force=True).verified, "the chain is there as before"


def test_a_board_that_goes_silent_is_reported(sim: ucom.SimulatedChain, bus: Bus) -> None:
    with pytest.raises(errors.FaultError) as not_stopped:
        with ucom.connect(sim) as chain:
            chain.init()
            chain.run(active=True)
            sim.fault("silent board=3")
            with pytest.raises(errors.FaultError) as lost:
                for _ in chain.monitor(seconds=60):
                    pass
            assert lost.value.code == "lost" and lost.value.board == 3
            kinds = [event.kind for event in chain.events() if event.board == 3]
            assert kinds.index("late") < kinds.index("lost")
            with pytest.raises(errors.NoLinkError) as stale:
                chain["3.position"]
            assert stale.value.code == "stale" and stale.value.board == 3
            with pytest.raises(errors.NoLinkError) as all_stale:
                chain.values()
            assert all_stale.value.code == "stale" and all_stale.value.board in (1, 2, 3)
            bus.wait(lambda: not bus.runs(1) and not bus.runs(2))
            assert not chain.doctor().healthy
    assert not_stopped.value.code == "not-stopped"


def test_what_nobody_has_looked_at_is_an_error_at_the_end(numbered: ucom.SimulatedChain, numbered_bus: Bus) -> None:
    with pytest.raises(errors.FaultError) as left:
        with ucom.connect(numbered) as chain:
            chain.run()
            # Another PC sends MCA_ADMIN_DATA with all flags 0 to board 2.
            numbered_bus.send(ADMIN_TO + 2, bytes(4))
            numbered_bus.wait(lambda: any(event.kind == "left-loop" for event in chain.events()))
    assert left.value.code == "left-loop" and left.value.board == 2


def test_ctrl_c_leaves_outputs_safe(numbered: ucom.SimulatedChain, numbered_bus: Bus) -> None:
    with ucom.connect(numbered) as chain:
        chain.run([1, 2], active=True)
        chain.start(3)
        assert numbered_bus.runs(1) and numbered_bus.sends_outputs(1)
        timer = threading.Timer(0.2, _thread.interrupt_main)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            # The control loop of board 3 does not run, so this call waits.
            next(chain.monitor(3))
        timer.join()
        # The check is made before the context ends.
        assert not any(numbered_bus.started(board) for board in (1, 2, 3)) and not numbered_bus.sends_outputs(1)
        assert chain.board_values(1)[1].stale


CHILD = """
import sys
from openjtc import ucom
chain = ucom.connect(sys.argv[1])
chain.run([1, 2], active=True)
print("runs", flush=True)
if sys.argv[2] == "monitor":
    list(chain.monitor())
"""


@pytest.mark.parametrize("how", ["monitor", "end"])
def test_a_program_that_ends_leaves_outputs_safe(numbered: ucom.SimulatedChain, numbered_bus: Bus, how: str) -> None:
    """The test does not use a context manager: it covers Ctrl-C in a call, and the end of the program."""
    before = len(numbered_bus.frames)
    child = subprocess.Popen([sys.executable, "-c", CHILD, numbered.url, how], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None and child.stdout.readline() == "runs\n"
    if how == "monitor":
        assert numbered_bus.sends_outputs(1)
        child.send_signal(signal.SIGINT)
    assert child.wait(30) == (-signal.SIGINT if how == "monitor" else 0)
    child.stdout.close()
    # The program itself has stopped the boards, because their applications have ended. Missing heartbeats would only
    # end the control loops.
    assert not numbered_bus.started(1) and not numbered_bus.started(2)
    numbered_bus.wait(lambda: numbered_bus.came(ADMIN_TO + 1, ACTIVE, before))
    ran = numbered_bus.frames.index((ADMIN_TO + 1, ACTIVE), before)
    stopped = numbered_bus.when(ADMIN_TO + 1, STOPPED, ran)
    frames, times = numbered_bus.frames[ran:], numbered_bus.times[ran:]
    heartbeats = [at for frame, at in zip(frames, times) if frame == ALIVE and at <= stopped]
    assert not heartbeats or stopped - heartbeats[-1] < 1.4, "a board does so itself after 1.5 s"


def test_a_stop_from_another_thread_goes_first(numbered: ucom.SimulatedChain, numbered_bus: Bus) -> None:
    with ucom.connect(numbered) as chain:
        chain.run([1, 2], active=True)
        failed: list[errors.Error] = []

        def examine() -> None:
            try:
                while True:
                    chain.doctor()
            except errors.Error as error:
                failed.append(error)

        thread = threading.Thread(target=examine)
        thread.start()
        while thread.is_alive():
            stopped = chain.stop()
            thread.join(0.3)
        assert failed[0].code == "cancelled"
        assert all(board.state == "exloader" for board in stopped.values())
        assert not numbered_bus.started(1) and not numbered_bus.started(2)


def test_a_stop_refuses_what_waits_for_the_end_of_an_update(numbered: ucom.SimulatedChain) -> None:
    image = bytes(i * i % 241 for i in range(60_000))
    begun = threading.Event()
    failed: list[errors.Error] = []
    with ucom.connect(numbered) as chain:

        def program() -> None:
            chain.update(image, 1, raw=True, force=True, progress=lambda _: begun.set())

        def scan() -> None:
            try:
                chain.scan()
            except errors.Error as error:
                failed.append(error)

        update, scanning, stopping = [threading.Thread(target=act) for act in (program, scan, chain.stop)]
        update.start()
        assert begun.wait(30)
        scanning.start()
        time.sleep(0.1)
        stopping.start()
        scanning.join(30)
        assert update.is_alive(), "the update goes on"
        assert failed[0].code == "cancelled"
        update.join()
        stopping.join()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_stop_ends_a_run_that_still_reads_its_file(
    numbered: ucom.SimulatedChain, numbered_bus: Bus, tmp_path: Path
) -> None:
    file = tmp_path / "parameters.yaml"
    os.mkfifo(file)
    with ucom.connect(numbered) as chain:
        failed: list[errors.Error] = []

        def run() -> None:
            try:
                chain.run(1, file=file, active=True)
            except errors.Error as error:
                failed.append(error)

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        # The run reads the pipe from this point on.
        with file.open("w") as pipe:
            chain.stop()
            pipe.write("boards:\n  - board: 1\n    flash_number: 0x0021\n    program_id: any\n    par:\n      kp: 1\n")
        thread.join(30)
        assert failed[0].code == "cancelled"
        assert not numbered_bus.started(1)


def test_another_master_is_not_disturbed(sim: ucom.SimulatedChain, bus: Bus) -> None:
    with ucom.connect(sim) as chain:
        chain.init()
        sim.fault("foreign-master for_s=60")
        bus.wait(lambda: (0x680, b"") in bus.frames[-50:])
        with pytest.raises(errors.RefusedError) as other:
            chain.run(1)
        assert other.value.code == "foreign-master"


@pytest.mark.skipif(not os.environ.get("UCOM"), reason="UCOM names no program `ucom`")
def test_python_can_sees_what_a_chain_does_on_the_bus_of_the_program() -> None:
    can = pytest.importorskip("can")
    program = os.environ["UCOM"]
    assert shutil.which(program) or Path(program).exists()
    child = subprocess.Popen(
        [program, "sim", "--boards", "2", "--listen", "127.0.0.1:0", "--json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert child.stdout is not None
        found = re.search(r"socketcand:([\d.]+):(\d+)/(\w+)", child.stdout.readline())
        assert found is not None
        host, port, channel = found.groups()
        with can.Bus(interface="socketcand", host=host, port=int(port), channel=channel) as peer:
            with ucom.connect(found[0]) as chain:
                assert len(chain.init().boards) == 2
                chain.run(active=True, inputs={"1.set_position": 700})
                since = time.monotonic()
                outputs: dict[int, int] = {}
                while abs(outputs.get(1, 0) - 700) > 60:
                    assert time.monotonic() - since < 30, outputs
                    message = peer.recv(1)
                    # Packages of sensor outputs contain an offset, then up to three words.
                    if message is not None and 0x381 <= message.arbitration_id <= 0x39F and message.data[:2] == b"\0\0":
                        outputs[message.arbitration_id - 0x380] = int.from_bytes(message.data[2:4], "little", signed=True)
                assert abs(float(chain["1.position"] or 0) - 700) < 80
            while peer.recv(0) is not None:
                pass
            peer.send(can.Message(arbitration_id=0x201, is_extended_id=False))
            while (answer := peer.recv(5)) is not None and (answer.arbitration_id, answer.dlc) != (0x141, 8):
                pass
            assert answer is not None and not answer.data[3] & 0xA0, "neither started nor running"
    finally:
        child.terminate()
        child.wait(30)
