"""Checks `jtc serve --sim --modbus` with a PLC played by pymodbus, which knows only the tables of docs/modbus.md and the HTTP API.

usage: check_modbus.py JTC

JTC is the command `jtc`. The PLC finds its registers by their names on the page. The PLC recovers the arm, starts trajectory 3, pauses,
resumes, changes the speed, compares its registers with /api/status, stops, loses its connection, repeats commands, and writes invalid
values. Needs pymodbus.
"""

import contextlib
import json
import math
import re
import socket
import struct
import threading
import time

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

import served

PAGE = served.DOCS / "modbus.md"
# Codes that this script uses, from the tables of the page.
DONE, SEQUENCE, VALUE, NO_TRAJECTORY, BUSY, HELD, STOPPED, COIL, NOT_READY = 1, 2, 3, 4, 5, 6, 7, 8, 9
START, PAUSE, RESUME, STOP, TEACH, TEACH_OFF, PUMP_ON, PUMP_OFF, CLEAR, RECOVER, DEFAULTS, SPEED, RELEASE = range(1, 14)
RUNNING, FINISHED, STOPPED_JOB, FAILED = 1, 2, 3, 4
# The first value is long enough for a busy computer. The second one is for tests in which the watchdog expires.
WATCHDOG_MS, SHORT_MS = 10_000, 2000
WORDS = {"u16": 1, "u32": 2, "f32": 2}


def tables():
    """Returns, for each table of the page, a mapping from names to (address, count, form)."""
    found, title = {}, None
    for line in PAGE.read_text().splitlines():
        if line.startswith("### "):
            title = re.sub(r" \(.*", "", line[4:])
            found[title] = {}
        elif title and (row := re.match(r"\| (\d+)(?: to \d+)? \| `(\w+)` \| ([^|]*) \|", line)):
            address, name, third = int(row[1]), row[2], row[3]
            form = re.fullmatch(r"(?:(\d) × )?(u16|u32|f32)", third)
            count, form = (int(form[1] or 1), form[2]) if form else (1, "u16")
            found[title][name] = (address, count, form)
    return found


MAP = tables()
INPUTS, HOLDINGS = MAP["Input registers"], MAP["Holding registers"]
DISCRETE, COILS = MAP["Discrete inputs"], MAP["Coils"]
INPUTS_END = max(address + count * WORDS[form] for address, count, form in INPUTS.values())


class Plc:
    """A PLC with its own connection, which sends ten requests per second in the background, like a PLC cycle."""

    def __init__(self, port, cyclic=True):
        self.client = ModbusTcpClient("127.0.0.1", port=port, timeout=5, retries=0)
        assert self.client.connect()
        self.lock = threading.Lock()
        self.open = True
        if cyclic:
            threading.Thread(target=self.cycle, daemon=True).start()

    def cycle(self):
        while self.open:
            with contextlib.suppress(ModbusException, OSError):
                self.do("read_input_registers", 0, count=2)
            time.sleep(0.1)

    def do(self, function, *arguments, **named):
        """Returns the response of the server, even if it is an exception."""
        with self.lock:
            return getattr(self.client, function)(*arguments, **named)

    def leave(self):
        """Closes the connection without a message."""
        self.open = False
        with self.lock:
            self.client.close()

    def inputs(self):
        """Returns all input registers by name, from one request."""
        response = self.do("read_input_registers", 0, count=INPUTS_END)
        assert not response.isError(), response
        words, values = response.registers, {}
        for name, (address, count, form) in INPUTS.items():
            if form == "u16":
                found = words[address : address + count]
            else:
                raw = struct.pack(f">{2 * count}H", *words[address : address + 2 * count])
                found = struct.unpack(f">{count}{'f' if form == 'f32' else 'I'}", raw)
            values[name] = found[0] if count == 1 else list(found)
        return values

    def bits(self):
        response = self.do("read_discrete_inputs", 0, count=len(DISCRETE))
        assert not response.isError(), response
        return {name: response.bits[address] for name, (address, _, _) in DISCRETE.items()}

    def write(self, name, *values):
        return self.do("write_registers", HOLDINGS[name][0], list(values))

    def coil(self, name, on):
        return self.do("write_coil", COILS[name][0], on)

    def command(self, command, trajectory=0, speed=100, repeat=1, approach=0, watchdog=WATCHDOG_MS, policy=1):
        """Writes all eight registers at once and waits for the answer; returns its result and the registers at that time."""
        sequence = (self.inputs()["acknowledged"] + 1) % 65536
        response = self.write("watchdog_ms", watchdog, policy, trajectory, speed, repeat, approach, command, sequence)
        assert not response.isError(), response
        now = self.until(lambda now: now["acknowledged"] == sequence)
        return now["result"], now

    def until(self, reached, patience=served.PATIENCE_S):
        end = time.monotonic() + patience
        while time.monotonic() < end:
            now = self.inputs()
            if reached(now):
                return now
            time.sleep(0.02)
        raise AssertionError(f"not reached: {now}")

    def job_over(self):
        return self.until(lambda now: now["job_stage"] != RUNNING)


class Agent(served.Requests):
    """Sends requests to an agent, and knows the port of its Modbus server."""

    def __init__(self, agent):
        super().__init__(agent.url, agent.tokens["operator"])
        self.port = int(agent.ready["modbus"].rsplit(":", 1)[1])

    def http(self, request, body=None, key=None):
        """Returns status and body of the answer."""
        method, path = request.split(" ")
        status, text, _ = self.ask(method, path, body, **({"Lease-Key": key} if key else {}))
        return status, json.loads(text) if text else None

    def joints(self):
        controller = self.http("GET /api/status")[1]["controller"]
        return controller, [joint["position_rad"] for joint in controller["joints"]]


@contextlib.contextmanager
def serving(jtc, directory):
    """Runs `jtc serve --sim` with a Modbus server."""
    options = ["--baud", "921600", "--modbus", "127.0.0.1:0", "--trajectories", directory / "motions"]
    with served.serving(jtc, directory, *options, "--command-log", directory / "commands.jsonl") as agent:
        yield Agent(agent)


def motion(seconds, amplitude=0.3):
    """Returns a smooth motion of two joints, there and back, as CSV."""
    lines, steps = ["t,q1,q2,q3,q4,q5,q6"], round(seconds / 0.02)
    for n in range(steps + 1):
        q = amplitude * math.sin(math.pi * n / steps) ** 4
        lines.append(f"{0.02 * n:.2f},{q:.9f},0,0,{-q:.9f},0,0")
    return "\n".join(lines) + "\n"


def recover(agent, plc):
    result, now = plc.command(DEFAULTS)
    assert result == DONE and now["lease"] == 1, now
    now = plc.job_over()
    assert now["job_stage"] == FINISHED and now["job_error"] == 0, now
    # "Finished" comes with HoldPos. All drives are enabled shortly after that.
    plc.until(lambda now: plc.bits()["ready"])
    assert agent.http("GET /api/status")[1]["lease"]["holder"].startswith("the PLC")
    result, now = plc.command(CLEAR)
    assert result == DONE and now["errors_occurred"] == 0, now


def runs(agent, plc):
    """Starts, pauses, resumes and changes the speed; compares the registers with HTTP."""
    assert plc.command(START, trajectory=9)[0] == NO_TRAJECTORY
    result, now = plc.command(START, trajectory=3, approach=1)
    assert result == DONE and now["job"] > 0, now
    job = now["job"]
    plc.until(lambda now: now["trajectory_state"] == 3 and now["point"] > 2000)
    assert plc.bits()["executing"] and not plc.bits()["ready"]
    # Only one command may run at a time.
    for other in (START, CLEAR, PUMP_ON, TEACH, RECOVER, RELEASE):
        result, now = plc.command(other, trajectory=3)
        assert result == BUSY and now["job"] == job, (other, now)
    assert plc.command(PAUSE)[0] == DONE
    paused = plc.until(lambda now: now["trajectory_state"] == 2)
    assert plc.bits()["paused"]
    controller, positions = agent.joints()
    assert controller["trajectory"] == "Pause" and controller["point"] == paused["point"], (controller, paused)
    assert any(abs(q) > 0.01 for q in positions), "it has moved"
    now = plc.inputs()
    assert all(abs(a - b) < 2e-3 for a, b in zip(now["position"], positions)), (now["position"], positions)
    assert plc.command(SPEED, speed=50)[0] == DONE
    assert plc.command(SPEED, speed=101)[0] == VALUE
    assert plc.command(RESUME)[0] == DONE
    now = plc.until(lambda now: now["trajectory_state"] == 3)
    assert now["speed_override"] == 50, now
    assert plc.command(SPEED, speed=100)[0] == DONE
    now = plc.job_over()
    assert (now["job"], now["job_stage"], now["job_runs"], now["job_error"]) == (job, FINISHED, 1, 0), now
    assert plc.command(RESUME)[0] == NOT_READY
    # Finished and at rest: registers and HTTP agree.
    time.sleep(0.5)
    controller, positions = agent.joints()
    now = plc.inputs()
    assert all(abs(a - b) < 1e-3 for a, b in zip(now["position"], positions)), (now["position"], positions)
    temperatures = [joint["temperature_c"] for joint in controller["joints"]]
    assert now["temperature"] == temperatures, (now["temperature"], temperatures)
    told = agent.http(f"GET /api/jobs/{job}")[1]
    assert told["stage"] == "finished" and told["client"].startswith("the PLC"), told


def repeats(agent, plc):
    """Checks that only the next sequence number starts a motion."""
    now = plc.inputs()
    job, acknowledged = now["job"], now["acknowledged"]
    for sequence in (acknowledged, acknowledged, (acknowledged + 2) % 65536, (acknowledged - 1) % 65536):
        response = plc.write("watchdog_ms", WATCHDOG_MS, 1, 3, 100, 1, 1, START, sequence)
        assert not response.isError()
        time.sleep(0.2)
        now = plc.inputs()
        assert now["job"] == job and now["acknowledged"] == acknowledged and now["trajectory_state"] != 3, now
        assert now["result"] == (SEQUENCE if sequence != acknowledged else now["result"]), now
    # A part of the registers, in an unusual order, is not a command yet. The sequence number makes it a command, once.
    for name, value in (("command", START), ("trajectory", 3), ("approach", 1), ("speed", 100)):
        assert not plc.do("write_register", HOLDINGS[name][0], value).isError()
    assert plc.inputs()["job"] == job
    for _ in range(3):
        assert not plc.do("write_register", HOLDINGS["sequence"][0], (acknowledged + 1) % 65536).isError()
    now = plc.until(lambda now: now["acknowledged"] == (acknowledged + 1) % 65536)
    assert now["result"] == DONE and now["job"] == job + 1, now
    assert plc.until(lambda now: now["trajectory_state"] == 3)
    assert not plc.coil("stop", True).isError()
    now = plc.job_over()
    assert now["job"] == job + 1 and now["job_stage"] == STOPPED_JOB, now
    assert plc.command(START, trajectory=3, approach=1)[0] == COIL
    # Writing the same value again is not an edge.
    assert not plc.coil("stop", True).isError() and not plc.coil("stop", False).isError()
    plc.until(lambda now: plc.bits()["ready"])


def nonsense(agent, plc):
    """Checks the standard's exceptions: a request with an exception writes nothing."""
    before = plc.do("read_holding_registers", 0, count=len(HOLDINGS)).registers
    job = plc.inputs()["job"]
    end = len(HOLDINGS)
    watchdog = HOLDINGS["watchdog_ms"][0]
    wrong = [
        (2, "read_input_registers", (INPUTS_END,), {"count": 1}),
        (2, "read_input_registers", (INPUTS_END - 1,), {"count": 2}),
        (2, "read_holding_registers", (end,), {"count": 1}),
        (2, "read_discrete_inputs", (len(DISCRETE),), {"count": 1}),
        (2, "read_coils", (len(COILS),), {"count": 1}),
        (2, "write_register", (end, 1), {}),
        (2, "write_coil", (len(COILS), True), {}),
        (2, "write_registers", (end - 1, [1, 2]), {}),
        (2, "write_coils", (1, [True, True]), {}),
        (3, "write_register", (HOLDINGS["command"][0], 14), {}),
        (3, "write_register", (HOLDINGS["trajectory"][0], 100), {}),
        (3, "write_register", (HOLDINGS["policy"][0], 3), {}),
        (3, "write_register", (watchdog, 50), {}),
        (3, "write_register", (watchdog, 0), {}),
        (3, "write_registers", (0, [1000, 1, 3, 0, 1, 1, START, 1]), {}),
        (1, "mask_write_register", (), {"address": 0, "and_mask": 0, "or_mask": 0}),
        (1, "read_exception_status", (), {}),
    ]
    for code, function, arguments, named in wrong:
        response = plc.do(function, *arguments, **named)
        assert response.isError() and response.exception_code == code, (function, arguments, response)
    assert plc.do("read_holding_registers", 0, count=end).registers == before
    # Sends requests that pymodbus never sends: half a frame, other protocols, invalid lengths.
    pieces = [b"\0\1\0\0\0\6\1\5\0\0\1\0", b"\0\1\0\0\0\7\1\x0f\0\0\xff\xff\0", b"\0\1\0\0\0\x09\1\x10\0\0\x80\1\2\0\0"]
    for piece in pieces:
        with socket.create_connection(("127.0.0.1", agent.port), timeout=5) as raw:
            raw.sendall(piece)
            answer = raw.recv(300)
            assert answer[7] == piece[7] | 0x80 and answer[8] == 3, answer
    for piece in (b"GET /api/status HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03", b"\0\1\0\0\xff\xff\1\5", b"\0\1\0\0\0\1\1"):
        with socket.create_connection(("127.0.0.1", agent.port), timeout=5) as raw:
            raw.sendall(piece)
            with contextlib.suppress(ConnectionResetError):
                assert raw.recv(300) == b"", "it is closed"
    now = plc.inputs()
    assert now["job"] == job and now["trajectory_state"] != 3, now


def two(agent, plc):
    """Checks a second connection, which may read and stop, but not command."""
    other = Plc(agent.port, cyclic=False)
    assert plc.command(START, trajectory=3, approach=1)[0] == DONE
    plc.until(lambda now: now["trajectory_state"] == 3)
    assert other.inputs()["lease"] == 2 and plc.inputs()["lease"] == 1
    response = other.write("trajectory", 5)
    assert response.isError() and response.exception_code == 6, response
    assert plc.do("read_holding_registers", HOLDINGS["trajectory"][0], count=1).registers == [3]
    assert not other.coil("stop", True).isError()
    now = plc.job_over()
    assert now["job_stage"] == STOPPED_JOB, now
    # Commands are refused while the coil is set, and for three seconds afterwards.
    assert plc.command(START, trajectory=3, approach=1)[0] == COIL
    assert not other.coil("stop", False).isError()
    assert plc.command(START, trajectory=3, approach=1)[0] == STOPPED
    job = now["job"]
    time.sleep(3.6)
    assert plc.inputs()["job"] == job and plc.inputs()["trajectory_state"] != 3
    # A Stop by HTTP is also a Stop of another client.
    agent.http("POST /api/stop")
    assert plc.command(START, trajectory=3, approach=1)[0] == STOPPED
    time.sleep(3.6)
    other.leave()


def held(agent, plc):
    """Checks that the PLC's commands are refused while an HTTP client holds the lease, and that reading continues."""
    assert plc.command(RELEASE)[0] == DONE and plc.inputs()["lease"] == 0
    grant = agent.http("POST /api/lease", {"name": "anna", "lasts_s": 30})[1]
    assert grant["held"], grant
    for command in (START, RESUME, TEACH, PUMP_ON, CLEAR, RECOVER, SPEED):
        result, now = plc.command(command, trajectory=3, approach=1)
        assert result in (HELD, NOT_READY) and (command in (RESUME,) or result == HELD), (command, now)
        assert now["lease"] == 2 and now["trajectory_state"] != 3, now
    agent.http("DELETE /api/lease", key=grant["key"])
    # After its lease was released, the PLC cannot command without a watchdog.
    assert plc.command(RELEASE)[0] == DONE
    assert plc.command(PUMP_ON, watchdog=0)[0] == VALUE and plc.inputs()["lease"] == 0
    assert plc.command(PUMP_ON)[0] == DONE
    plc.until(lambda now: now["pump"] == 1 and plc.bits()["pump"])
    assert plc.command(PUMP_OFF)[0] == DONE
    assert plc.command(TEACH)[0] == DONE and plc.until(lambda now: now["state"] == 4) and plc.bits()["teaching"]
    assert plc.command(START, trajectory=3)[0] == NOT_READY
    assert plc.command(TEACH_OFF)[0] == DONE
    plc.until(lambda now: plc.bits()["ready"])
    # The check refuses the trajectory. The registers contain the numbers of the joint and of the point.
    far = "t,q1,q2,q3,q4,q5,q6\n0,0,9,0,0,0,0\n1,0,9,0,0,0,0\n"
    assert agent.http("PUT /api/trajectories/4", {"name": "far", "text": far})[0] == 200
    assert plc.command(START, trajectory=4)[0] == DONE
    now = plc.job_over()
    error = agent.http(f"GET /api/jobs/{now['job']}")[1]["error"]
    assert now["job_stage"] == FAILED and now["job_error_joint"] == error["joint"] == 2, (now, error)
    assert now["job_error_point"] == error["point"] and f"| {now['job_error']} | `{error['code']}` |" in PAGE.read_text(), (now, error)


def watchdog(agent, plc):
    """Checks a lost connection during a motion. The motion pauses; then the PLC connects again and resumes it."""
    result, now = plc.command(START, trajectory=3, approach=1, watchdog=SHORT_MS)
    assert result == DONE, now
    plc.until(lambda now: now["trajectory_state"] == 3 and now["point"] > 300)
    # A client that only reads does not renew another client's lease, however often it reads.
    viewer = Plc(agent.port)
    job, left = now["job"], time.monotonic()
    plc.leave()
    while agent.joints()[0]["trajectory"] != "Pause":
        assert time.monotonic() - left < served.PATIENCE_S, "it does not pause"
        time.sleep(0.02)
    took = time.monotonic() - left
    assert took > SHORT_MS / 2000, f"paused after {took} s already"
    assert agent.http("GET /api/status")[1].get("lease") is None
    again = Plc(agent.port)
    now = again.inputs()
    assert now["lease"] == 0 and now["job_stage"] == RUNNING, now
    # The registers are unchanged, and writing the same values again begins nothing.
    sequence = again.do("read_holding_registers", HOLDINGS["sequence"][0], count=1).registers[0]
    assert not again.write("watchdog_ms", SHORT_MS, 1, 3, 100, 1, 1, START, sequence).isError()
    assert again.command(RESUME, watchdog=SHORT_MS)[0] == STOPPED, "the watchdog's pause is somebody else's"
    time.sleep(3.6)
    assert again.inputs()["trajectory_state"] == 2
    assert again.command(RESUME, watchdog=SHORT_MS)[0] == DONE
    again.until(lambda now: now["trajectory_state"] == 3)
    # A PLC that stays connected but sends nothing has the same effect.
    again.open = False
    end = time.monotonic() + served.PATIENCE_S
    while agent.joints()[0]["trajectory"] != "Pause":
        assert time.monotonic() < end, "it does not pause"
        time.sleep(0.1)
    # The command `stop` ends the motion.
    assert again.command(STOP)[0] == DONE
    now = again.job_over()
    assert (now["job"], now["job_stage"]) == (job, STOPPED_JOB), now
    again.leave()
    # After this time the hold-off of three seconds after the watchdog's pause has ended.
    time.sleep(3.6)
    # The other policies: the motion stops, or continues to its end.
    for policy, stage in ((2, STOPPED_JOB), (0, FINISHED)):
        plc = Plc(agent.port)
        assert plc.command(START, trajectory=3, approach=1, watchdog=SHORT_MS, policy=policy)[0] == DONE
        plc.until(lambda now: now["trajectory_state"] == 3 and now["point"] > 300)
        plc.leave()
        now = viewer.job_over()
        assert now["job_stage"] == stage and now["lease"] == 0, (policy, now)
        time.sleep(3.6)
    viewer.leave()
    return took


def restarted(jtc, directory, sequence, motions):
    """Checks an agent after a restart, with a PLC that continues to write its old registers."""
    with serving(jtc, directory) as agent:
        plc = Plc(agent.port)
        if plc.inputs()["acknowledged"] != (sequence - 1) % 65536:
            assert not plc.write("watchdog_ms", WATCHDOG_MS, 1, 3, 100, 1, 1, START, sequence).isError()
            now = plc.until(lambda now: now["result"] != 0)
            assert now["result"] == SEQUENCE and now["job"] == 0, now
        # The trajectories are still there after the restart. The arm of this agent is not up yet.
        assert [kept["number"] for kept in agent.http("GET /api/trajectories")[1]] == motions
        plc.until(lambda now: plc.bits()["controller_there"])
        assert plc.command(START, trajectory=3)[0] == NOT_READY
        plc.leave()


def commanded(jtc, directory):
    """Checks a PLC with an agent, from the start of the agent to its restart."""
    assert len(COILS) == 2 and len(HOLDINGS) == 8 and len(INPUTS) > 20, MAP
    with serving(jtc, directory) as agent:
        assert agent.http("PUT /api/trajectories/3", {"name": "there and back", "text": motion(6)})[0] == 200
        plc = Plc(agent.port)
        first = plc.until(lambda now: plc.bits()["controller_there"])
        assert first["simulated"] == 1 and first["port_lost"] == 0 and first["result"] == 0 and first["lease"] == 0, first
        assert plc.command(START, trajectory=3)[0] == NOT_READY, "the controller has no arm yet"
        recover(agent, plc)
        runs(agent, plc)
        repeats(agent, plc)
        nonsense(agent, plc)
        two(agent, plc)
        held(agent, plc)
        beats = plc.inputs()["heartbeat"]
        took = watchdog(agent, plc)
        last = Plc(agent.port, cyclic=False)
        now = last.inputs()
        assert now["heartbeat"] != beats
        last.leave()
    lines = [json.loads(line) for line in (directory / "commands.jsonl").read_text().splitlines()]
    commands = [line for line in lines if line["what"] == "command"]
    refused = sum(line["why_not"] is not None for line in commands)
    halts = [line for line in lines if line["what"] == "halt" and line["by"].startswith("the PLC at 127.0.0.1")]
    assert len(commands) > 30 and refused > 10 and len(halts) >= 4, (len(commands), refused, len(halts))
    restarted(jtc, directory, now["acknowledged"], [3, 4])
    print(f"{len(commands)} commands by Modbus, {refused} of them refused; paused {took:.2f} s after the connection was lost")


if __name__ == "__main__":
    served.run(commanded)
