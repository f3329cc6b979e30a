"""Tests of heartbeats at the end of a chain, and of boards that do not answer."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from ucom_bus import (  # noqa: F401  # fixtures
    ACTIVE,
    ADMIN_TO,
    ALIVE,
    SAFE,
    STOPPED,
    Bus,
    bus,
    numbered,
    numbered_bus,
    sim,
)

from openjtc import errors, ucom

#: PC_START and MCA_PC_START to board 0, and the answer to PC_START.
START, START_LOOP, READY = 0x300, 0x540, 0x500
#: Time for which a board is silent, s. The profile of this test counts a board as lost after 20 s.
SILENT_S = 2.5


@pytest.fixture
def patient(tmp_path: Path) -> Path:
    """Returns a profile in which a board counts as lost only after 20 s of silence."""
    profile = tmp_path / "patient.toml"
    profile.write_text("alive.dsp_lost = 20000\n")
    return profile


def heartbeats(bus: Bus, seconds: float) -> int:
    """Counts the heartbeats that a PC sends within this time."""
    before = len(bus.frames)
    time.sleep(seconds)
    return bus.frames[before:].count(ALIVE)


def runs_for_a_stranger(bus: Bus, board: int) -> None:
    """Starts the control loop of a board from another client of the bus."""
    before = len(bus.frames)
    bus.send(START + board)
    bus.wait(lambda: bus.came(READY + board, b"", before))
    bus.send(START_LOOP + board)
    bus.wait(lambda: bus.came(ADMIN_TO + board, SAFE, before))


def silent(sim: ucom.SimulatedChain, board: int, seconds: float = SILENT_S) -> float:
    """Makes a board silent from now on. Returns the time at which the silence begins."""
    begun = time.monotonic()
    sim.fault(f"silent board={board} for_s={seconds}")
    time.sleep(0.1)
    return begun


def test_heartbeats_are_for_what_was_started_here(numbered: ucom.SimulatedChain, numbered_bus: Bus) -> None:
    with ucom.connect(numbered) as chain:
        runs_for_a_stranger(numbered_bus, 3)
        assert chain.stop(3, application=False)[3].state == "started"
        assert heartbeats(numbered_bus, 1.2) == 0 and not chain.bus().is_master
        chain.run(1)
        chain.stop(1, application=False)
        assert heartbeats(numbered_bus, 1.2) >= 2 and chain.bus().is_master, "its application was started here"
        chain.stop(1)
        numbered_bus.wait(lambda: not chain.bus().is_master)
        assert heartbeats(numbered_bus, 1.2) == 0
    assert numbered_bus.started(3), "it is not this chain's"
    with ucom.connect(numbered) as chain:
        chain.stop()


def test_outputs_are_made_safe_whatever_one_board_does(
    sim: ucom.SimulatedChain, bus: Bus, patient: Path
) -> None:
    with ucom.connect(sim, profile=patient) as chain:
        chain.init()
        chain.run(active=True)
        begun, before = silent(sim, 1), len(bus.frames)
        with pytest.raises(errors.NoLinkError, match="not safe for certain: board 1:") as failed:
            chain.outputs(False)
        assert failed.value.board == 1
        for board in (1, 2, 3):
            assert bus.came(ADMIN_TO + board, SAFE, before), board
        assert bus.runs(2) and bus.runs(3)
        time.sleep(max(0.0, begun + SILENT_S - time.monotonic()) + 0.2)
        assert bus.runs(1)


def test_outputs_that_are_enabled_before_one_fails_are_named(
    sim: ucom.SimulatedChain, bus: Bus, patient: Path
) -> None:
    with ucom.connect(sim, profile=patient) as chain:
        chain.init()
        chain.run()
        begun = silent(sim, 2)
        with pytest.raises(errors.NoLinkError, match="already changed: board 1") as failed:
            chain.outputs(True)
        assert failed.value.board == 2 and bus.came(ADMIN_TO + 1, ACTIVE) and not bus.came(ADMIN_TO + 3, ACTIVE)
        time.sleep(max(0.0, begun + SILENT_S - time.monotonic()) + 0.2)


def test_texts_that_cannot_be_had_are_no_failed_run(
    sim: ucom.SimulatedChain, bus: Bus, patient: Path
) -> None:
    with ucom.connect(sim, profile=patient) as chain:
        chain.init()

        def silence() -> None:
            # Waits for the frame that enables the board's outputs, and for the board's answer.
            bus.wait(lambda: bus.frames.count((ADMIN_TO + 1, ACTIVE)) == 2)
            silent(sim, 1)

        thread = threading.Thread(target=silence)
        thread.start()
        assert chain.run(1, active=True, texts=True).boards == (1,)
        thread.join()
        assert any(event.kind == "note" and "no texts" in event.text for event in chain.events())
        time.sleep(SILENT_S + 0.2)
        assert bus.runs(1)


def test_a_number_that_two_boards_have_is_an_error_while_one_runs(sim: ucom.SimulatedChain) -> None:
    chain = ucom.connect(sim)
    try:
        chain.init()
        chain.run(1)
        sim.fault("same-number board=2")
        time.sleep(0.1)
        with pytest.raises(errors.RefusedError):
            while True:
                chain.info(1)
        with pytest.raises(errors.FaultError) as shared:
            chain.check()
        assert shared.value.code == "number-shared" and shared.value.board == 1
        chain.check()
    finally:
        # The test commands both boards to stop. The answers of both boards look alike.
        with contextlib.suppress(errors.Error):
            chain.close()


def test_a_stop_in_the_middle_of_an_update_waits_for_no_byte_of_it(
    numbered: ucom.SimulatedChain, numbered_bus: Bus
) -> None:
    image = bytes(i * i % 241 for i in range(60_000))
    with ucom.connect(numbered) as chain:
        chain.run(1, active=True)
        results: list[ucom.UpdateReport] = []
        update = threading.Thread(target=lambda: results.append(chain.update(image, 2, raw=True, force=True)))
        update.start()
        # Waits for a PC_PROG frame to board 2.
        numbered_bus.wait(lambda: any(identifier == 0x2C2 for identifier, _ in numbered_bus.frames))
        before = len(numbered_bus.frames)
        chain.stop(1)
        assert numbered_bus.when(ADMIN_TO + 1, STOPPED, before) - numbered_bus.times[before - 1] < 0.5
        update.join()
        assert results[0].verified
        assert not numbered_bus.started(1)


def test_boards_of_a_program_that_asks_for_nothing_any_more_are_stopped(
    numbered: ucom.SimulatedChain, numbered_bus: Bus
) -> None:
    with pytest.raises(errors.UsageError, match="deadline_s"):
        ucom.connect(numbered, deadline_s=0)
    with pytest.raises(errors.FaultError) as late:
        with ucom.connect(numbered, deadline_s=1.0) as chain:
            chain.run(1, active=True)
            for _ in range(8):
                time.sleep(0.2)
                assert chain.values() and numbered_bus.runs(1)
            list(chain.monitor(1, seconds=1.5))
            assert numbered_bus.runs(1), "who reads what boards send has not gone"
            before = len(numbered_bus.frames)
            numbered_bus.when(ADMIN_TO + 1, STOPPED, before)
            numbered_bus.wait(lambda: not chain.bus().is_master)
            assert heartbeats(numbered_bus, 1.2) == 0 and not numbered_bus.started(1)
    assert late.value.code == "deadline"


def test_a_board_that_is_stopped_by_its_status_needs_no_heartbeats(
    numbered: ucom.SimulatedChain, numbered_bus: Bus
) -> None:
    with ucom.connect(numbered) as chain:
        assert chain.status(1, set=["MSTART"])[1].state == "started"
        assert heartbeats(numbered_bus, 1.2) >= 2, "it was started here"
        chain.status(1, clear=["MSTART"])
        assert heartbeats(numbered_bus, 1.2) == 0
        chain.status(2, set=["MSTART"])
    assert not numbered_bus.started(2), "stopped at the end, as what start() has started"


def test_boards_that_have_no_names_yet_do_not_hide_those_that_run(numbered: ucom.SimulatedChain) -> None:
    with ucom.connect(numbered) as chain:
        with pytest.raises(errors.RefusedError):
            chain.board_values()
        chain.run(2)
        assert set(chain.board_values()) == {2}
        assert {sample.board for sample in chain.monitor("all", count=3)} == {2}


ENDS = """
import sys
from openjtc import ucom
chain = ucom.connect(sys.argv[1], on_lost="report")
chain.run([1, 2], active=True)
print("runs", flush=True)
sys.stdin.readline()
"""

FORKS = """
import os, sys
from openjtc import errors, ucom
with ucom.connect(sys.argv[1]) as chain:
    chain.run(1)
    child = os.fork()
    if child == 0:
        try:
            chain.scan()
        except errors.UsageError as error:
            print(error.code, flush=True)
        chain.close()
        sys.exit(3)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), chain.values() != {}, flush=True)
"""


def test_the_end_of_a_program_names_boards_that_are_not_stopped_for_certain(
    sim: ucom.SimulatedChain, bus: Bus
) -> None:
    with ucom.connect(sim) as chain:
        chain.init()
    pipe = subprocess.PIPE
    child = subprocess.Popen([sys.executable, "-c", ENDS, sim.url], stdin=pipe, stdout=pipe, stderr=pipe, text=True)
    assert child.stdout is not None and child.stdout.readline() == "runs\n"
    silent(sim, 2, 6)
    _, printed = child.communicate("\n", 60)
    assert child.returncode == 0
    assert printed.splitlines()[-1].startswith("openjtc: not stopped for certain: board 2;"), printed
    assert not bus.started(1)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="only Unix forks")
def test_a_process_that_was_forked_ends_by_itself_and_leaves_the_chain(numbered: ucom.SimulatedChain) -> None:
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKS, numbered.url], capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["forked", "3", "True"], (done.stdout, done.stderr)
