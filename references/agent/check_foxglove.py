"""Checks `jtc serve --sim` with the Foxglove WebSocket client and the decoders that Foxglove and Lichtblick are built on.

usage: check_foxglove.py JTC

The client's packages come from npm, pinned by foxglove/package-lock.json, and run in the Node.js of the Python environment. The client
subscribes to every channel as those programs do. The decoded messages are compared with `/api/status`, while the arm rests and while it
moves, for `jtc traj run` and for a job of the agent. The client's service calls pause and stop the arm.
"""

import contextlib
import json
import math
import os
import pathlib
import queue
import shutil
import subprocess
import tempfile
import threading
import time
import xml.etree.ElementTree

import served

SOURCE = pathlib.Path(__file__).with_name("foxglove")
TOPICS = {"/joint_states", "/joint_commands", "/jtc/control", "/jtc/state", "/robot_description", "/tf", "/jtc/status"}


class Viewer:
    """The running viewer; its output is read line by line."""

    def __init__(self, process):
        self.process, self.lines = process, queue.Queue()
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.process.stdout:
            self.lines.put(json.loads(line))

    def forget(self):
        """Skips all messages received so far."""
        while not self.lines.empty():
            self.lines.get()

    def until(self, wanted):
        """Returns the first object for which `wanted` returns a result, and this result."""
        end = time.monotonic() + served.PATIENCE_S
        while time.monotonic() < end:
            with contextlib.suppress(queue.Empty):
                line = self.lines.get(timeout=1)
                assert not {"error", "failure"} & set(line), line
                if found := wanted(line):
                    return found
        raise AssertionError("the viewer did not receive it")

    def message(self, topic, wanted=lambda message: True):
        """Returns the next message of a topic for which `wanted` is true."""
        return self.until(lambda line: line.get("topic") == topic and wanted(line["message"]) and line["message"])

    def call(self, service):
        self.process.stdin.write(service + "\n")
        self.process.stdin.flush()
        return self.until(lambda line: line.get("answer"))


@contextlib.contextmanager
def viewing(packages, url):
    """Runs a viewer at this address of an agent."""
    command = [served.SCRIPTS / "node", packages / "viewer.cjs", url.replace("http://", "ws://")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            viewer = Viewer(process)
            yield viewer
            # The viewer closes its socket and ends.
            process.stdin.close()
            assert process.wait(served.ENDING_S) == 0
            viewer.reader.join()
        finally:
            process.kill()


def installed(directory):
    """Installs the packages in the versions of the lock file, and returns the viewer."""
    packages = directory / "packages"
    shutil.copytree(SOURCE, packages)
    command = [served.SCRIPTS / "npm", "ci", "--ignore-scripts", "--no-fund", "--no-audit", "--silent"]
    environment = os.environ | {"PATH": f"{served.SCRIPTS}{os.pathsep}{os.environ['PATH']}"}
    subprocess.run(command, cwd=packages, check=True, env=environment)
    return packages


def check_rest(viewer, arm):
    """Checks each channel once, with an arm at rest."""
    assert viewer.until(lambda line: line.get("info"))["capabilities"] == ["services"]
    assert set(viewer.until(lambda line: line.get("topics"))) == TOPICS
    urdf = xml.etree.ElementTree.fromstring(viewer.message("/robot_description")["data"])
    links = [link.get("name") for link in urdf.iter("link")]
    names = [joint.get("name") for joint in urdf.iter("joint") if joint.get("type") == "revolute"]
    joints = viewer.message("/joint_states")
    status = arm.json("GET", "/api/status")["controller"]
    assert joints["name"] == names
    for value, joint in zip(joints["position"], status["joints"], strict=True):
        assert abs(value - joint["position_rad"]) < 1e-3, (joints, status)
    transforms = viewer.message("/tf")["transforms"]
    assert [t["header"]["frame_id"] for t in transforms] == links[:-1]
    assert [t["child_frame_id"] for t in transforms] == links[1:]
    for t in transforms:
        assert abs(sum(value**2 for value in t["transform"]["rotation"].values()) - 1) < 1e-9, t
    assert viewer.message("/jtc/status")["state"] == status["state"] == "HoldPos"
    assert viewer.message("/jtc/state")["state"] == 2
    temperatures = viewer.message("/jtc/control")["temperature"]
    assert [round(t) for t in temperatures] == [joint["temperature_c"] for joint in status["joints"]]


def check_motion(viewer, arm):
    """Compares commanded and measured positions during a motion, and pauses and stops it by service calls."""
    number = arm.json("POST", "/api/runs", {"trajectory": 3, "repeat": 50})["number"]
    viewer.forget()
    try:
        viewer.message("/jtc/status", lambda message: message["trajectory"] == "Execute")
    except AssertionError as error:
        raise AssertionError(arm.json("GET", f"/api/jobs/{number}"), arm.json("GET", "/api/status")) from error
    commanded = viewer.message("/joint_commands", lambda message: abs(message["position"][0]) > 0.05)["position"]
    measured = viewer.message("/joint_states", lambda message: math.dist(message["position"], commanded) < 0.05)
    halt = viewer.call("pause")
    assert halt["sent"] == "pause"
    viewer.message("/jtc/status", lambda message: message["trajectory"] == "Pause")
    assert viewer.call("stop") == {"sent": "stop", "halt": halt["halt"] + 1}
    assert arm.over(number) == "stopped"
    print(f"moved to {measured['position'][0]:.3f} rad, paused and stopped by the viewer")


def check_commanded(viewer, jtc, directory, agent):
    """Checks the commanded positions while another program moves the arm through the agent."""
    motion = directory / "motion.csv"
    motion.write_text(served.sway(0.2, 4))
    command = [jtc, "traj", "run", motion, "--port", agent.url]
    with subprocess.Popen(command, env=agent.environment, stdout=subprocess.DEVNULL) as runs:
        most = viewer.message("/joint_commands", lambda message: message["position"][0] > 0.19)["position"][0]
        viewer.message("/joint_states", lambda message: abs(message["position"][0] - most) < 0.02)
        assert runs.wait(served.PATIENCE_S) == 0


def check(jtc, directory):
    with tempfile.TemporaryDirectory() as place:
        packages = installed(pathlib.Path(place))
        with served.serving(jtc, directory, "--baud", "921600") as agent:
            arm = served.Requests(agent.url, agent.tokens["operator"])
            arm.key = arm.json("POST", "/api/lease", {"name": "reference", "lasts_s": 60.0})["key"]
            arm.json("PUT", "/api/trajectories/3", {"name": "sway", "text": served.sway(0.3, 6)})
            assert arm.over(arm.json("POST", "/api/recover", {"defaults": True})["number"]) == "finished"
            with viewing(packages, agent.url + "/") as viewer:
                check_rest(viewer, arm)
                arm.ask("DELETE", "/api/lease")
                arm.key = None
                check_commanded(viewer, jtc, directory, agent)
                arm.key = arm.json("POST", "/api/lease", {"name": "reference", "lasts_s": 60.0})["key"]
                with arm.renewing():
                    check_motion(viewer, arm)


if __name__ == "__main__":
    served.run(check)
