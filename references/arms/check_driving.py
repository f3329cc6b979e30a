"""Drives arms from other projects' robot descriptions, from the URDF to the motion, on a controller with another built-in arm.

    python check_driving.py JTC [--board EMULATOR ELF] [--only NAME]

JTC is the command (`cargo build --release -p jtc-cli`). Each description of the package example-robot-data is imported, checked, pushed
and stored. Then the controller is switched off and on. Now its defaults must be that arm, with the same hash. A motion around the present
pose must end where it began, and its largest error is printed. A joint is jogged. The controller is `jtc sim`: the simulated arm is the
imported one, and the controller begins with the built-in arm. With --board the controller is the board's own program in the emulator,
which stores its flash in a file while it is off.
An arm file with another value in one component of gravity is refused with an error that mentions gravity.
"""

import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import time
import tomllib

import descriptions

# Each entry: name, file, options of the import.
ARMS = [
    ("ur5", "ur_description/urdf/ur5_robot.urdf", ["--tip", "ee_link"]),
    ("kinova", "kinova_description/robots/kinova.urdf", []),
    ("z1", "z1_description/urdf/z1.urdf", ["--joints", "joint1,joint2,joint3,joint4,joint5,joint6"]),
]
# Largest accepted error in rad. The error of a gear without play, a 16-bit encoder and the proposed gains is far smaller, that of a
# wrong model larger.
ERROR_MAX = 0.02
AMPLITUDE = 0.15
PATIENCE_S = 60


class Controller:
    """A program at a pseudo-terminal that acts as a controller until it is switched off."""

    def __init__(self, program, port):
        self.program = subprocess.Popen([str(word) for word in program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        ready = self.program.stdout.readline().strip()
        if ready != f"ready: {port}":
            self.program.kill()
            sys.exit(f"{program[0]}: {ready!r} instead of the port: {self.program.stderr.read()}")

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.program.terminate()
        try:
            _, printed = self.program.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.program.kill()
            raise
        assert self.program.returncode == 0, printed
        # The emulator reports resets and faults in this output.
        assert "reset" not in printed and "fault" not in printed.lower(), printed


class Desk:
    """Runs the command `jtc`, always with the same port."""

    def __init__(self, jtc, port):
        self.jtc, self.port = jtc, port

    def __call__(self, *words, code=0):
        command = [self.jtc, "--json", *map(str, words)]
        if words[:2] not in (("arm", "import"), ("arm", "check")):
            command += ["--port", str(self.port)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=5 * PATIENCE_S)
        assert done.returncode == code, f"{' '.join(map(str, command))}: {done.returncode}\n{done.stdout}{done.stderr}"
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        return lines[-1] if lines else json.loads(done.stderr.splitlines()[-1])


def motion(path, begin):
    """Writes a motion of each joint away from its present position and back, at rest at both ends: 4 s, one point every 20 ms."""
    lines = ["t,q1,q2,q3,q4,q5,q6"]
    for n in range(201):
        s = AMPLITUDE * math.sin(math.pi * n / 200) ** 4
        lines.append(",".join([f"{0.02 * n:.2f}", *(f"{q + (1 if q <= 0 else -1) * s:.9f}" for q in begin)]))
    path.write_text("\n".join(lines) + "\n")


def otherwise(arm, path):
    """Writes a copy of the arm file with another value in one component of gravity."""
    text = arm.read_text()
    gravity = next(line for line in text.splitlines() if line.strip().startswith("gravity"))
    values = tomllib.loads(gravity.split("#")[0])[gravity.split("=")[0].strip()]
    values[1] += 0.25
    path.write_text(text.replace(gravity, f"{gravity.split('=')[0]}= {values}"))


def drive(desk, switch_on, arm, folder):
    """Does all steps with one arm. Returns the largest error of the motion in rad."""
    with switch_on():
        pushed = desk("arm", "push", arm, "--store")
    with switch_on():
        desk("recover", "--defaults")
        differences = desk("arm", "diff", arm)
        assert differences["equal"] is True, differences
        begin = desk("status")["joints"]
        begin = [joint["position_rad"] for joint in begin]
        file, other, record = folder / "motion.csv", folder / "other.toml", folder / "record.csv"
        motion(file, begin)
        otherwise(arm, other)
        refused = desk("traj", "run", file, "--arm", other, code=4)
        assert "gravity" in json.dumps(refused), refused
        run = desk("traj", "run", file, "--arm", arm, "--approach", "--record", record)
        assert run["outcome"] == "finished", run
        error = largest_error(record)
        assert error < ERROR_MAX, f"{error} rad"
        jogged = desk("jog", 6, 0.1, "--duration", 1)
        moved = [b - a for a, b in zip(jogged["from_rad"], jogged["to_rad"])]
        # The duration is measured by the host, whose clock may be slower than the controller's.
        assert moved[5] > 0.05 and all(abs(way) < 0.01 for way in moved[:5]), jogged
        assert pushed["hash"] == desk("info")["hash"], "the stored arm is the one that was pushed"
    return error


def largest_error(record):
    """Returns the largest difference in rad between commanded and measured position in a recorded motion, over all joints and times."""
    with record.open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        # The columns are empty before the first point.
        rows = [row for row in rows if row["q1_set_position_rad"]]
    assert len(rows) > 50, f"{len(rows)} statuses of a motion of 4 s"
    return max(abs(float(row[f"q{j}_set_position_rad"]) - float(row[f"q{j}_position_rad"])) for row in rows for j in range(1, 7))


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("jtc")
    arguments.add_argument("--board", nargs=2, metavar=("EMULATOR", "ELF"))
    arguments.add_argument("--only")
    given = arguments.parse_args()
    robots = descriptions.folder()
    for name, file, named in ARMS:
        if given.only not in (None, name):
            continue
        with tempfile.TemporaryDirectory() as scratch:
            folder = pathlib.Path(scratch)
            port, arm, kept = folder / "port", folder / "arm.toml", folder / "kept"
            desk = Desk(given.jtc, port)
            desk("arm", "import", robots / file, *named, "-o", arm)
            desk("arm", "check", arm)
            if given.board:
                program = [given.board[0], given.board[1], "--serial", port, "--arm", arm, "--bank2", kept, "--speed", "max"]
            else:
                program = [given.jtc, "sim", "--serial", port, "--arm", arm, "--store", kept, "--speed", "max"]
            begin = time.monotonic()
            error = drive(desk, lambda: Controller(program, port), arm, folder)
            print(f"{name}: {1000 * error:.2f} mrad at most, {time.monotonic() - begin:.0f} s")


main()
