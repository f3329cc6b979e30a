"""A program that has nothing of ours but the agent's address and docs/openapi.json, against `jtc serve --sim`.

usage: check_api.py JTC

A client is generated from the description by openapi-python-client, and a second one is put together by Schemathesis from the same file:
the first takes the lease, keeps a trajectory, runs, pauses, goes on and reads the result, while another stops it and the commands `jtc
status`, `jtc monitor` and `jtc traj stop` look and stop from elsewhere; the second sends requests of all kinds, right and wrong, and
compares every answer with the description. Needs openapi-python-client and schemathesis.
"""

import contextlib
import importlib
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import urllib.request

DESCRIPTION = pathlib.Path(__file__).parents[2] / "docs" / "openapi.json"
SCRIPTS = pathlib.Path(sys.executable).parent
SEED = 20261123
PATIENCE_S = 60.0


@contextlib.contextmanager
def agent(jtc, directory):
    """`jtc serve --sim`, with its own folders; its address and its operator's token."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("JTC_")}
    environment |= {"XDG_STATE_HOME": str(directory / "state"), "XDG_RUNTIME_DIR": str(directory / "run")}
    (directory / "run").mkdir(exist_ok=True)
    command = [jtc, "serve", "--sim", "--listen", "127.0.0.1:0", "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=directory)
    try:
        ready = json.loads(process.stdout.readline())
        assert ready["simulated"] is True
        token = re.search('^operator = "(.*)"', pathlib.Path(ready["token_file"]).read_text(), re.M)[1]
        yield ready["url"], token, environment
    finally:
        process.terminate()
        assert process.wait(20) == 0


def generated(directory):
    """The client that openapi-python-client makes of the description."""
    command = [SCRIPTS / "openapi-python-client", "generate", "--path", DESCRIPTION, "--meta", "none"]
    path = f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        [*command, "--output-path", directory / "arm_client", "--fail-on-warning"],
        check=True,
        env=os.environ | {"PATH": path},
        stdout=subprocess.DEVNULL,
    )
    sys.path.insert(0, str(directory))
    return importlib.import_module("arm_client")


class Arm:
    """The generated client, with what every request of it needs."""

    def __init__(self, package, url, token):
        client = importlib.import_module(f"{package.__name__}.client")
        self.package = package
        self.client = client.AuthenticatedClient(base_url=url, token=token, timeout=20)
        self.key = None

    def model(self, kind, **values):
        return getattr(importlib.import_module(f"{self.package.__name__}.models"), kind).from_dict(values)

    def ask(self, operation, **values):
        """Status and parsed body of an operation."""
        module = importlib.import_module(f"{self.package.__name__}.api.default.{operation}")
        response = module.sync_detailed(client=self.client, **values)
        return int(response.status_code), response.parsed

    def command(self, operation, **values):
        return self.ask(operation, lease_key=self.key, **values)

    def take(self, name, **values):
        status, grant = self.ask("take_lease", body=self.model("LeaseRequest", name=name, **values))
        assert status == 200, grant
        self.key = grant.key
        return grant

    def over(self, number):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            status, job = self.ask("get_job", number=number)
            assert status == 200
            if job.stage != "running":
                return job
            if self.key:
                self.command("renew_lease")
            time.sleep(0.1)
        raise AssertionError(f"job {number} is not over")

    def event(self, kind, after=0):
        """The first event of a kind behind a number: no number is left out."""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            status, found = self.ask("get_events", after=after, wait_s=2.0)
            assert status == 200 and not found.missed
            for event in found.events:
                assert event.number == after + 1, (event.number, after)
                after = event.number
                if event.event.kind == kind:
                    return after, event.event
        raise AssertionError(f"no {kind} behind {after}: {self.ask('list_jobs')}")


def text(amplitude, seconds):
    """All joints there and back, at rest at both ends, every 10 ms; made with nothing of ours."""
    lines = ["t," + ",".join(f"q{j}" for j in range(1, 7))]
    steps = round(100 * seconds)
    for n in range(steps + 1):
        x = n / steps
        way = x - math.sin(2 * math.pi * x) / (2 * math.pi)
        q = amplitude * 0.5 * (1 - math.cos(2 * math.pi * way))
        lines.append(",".join(f"{v:.9f}" for v in [n / 100, q, -q, q, q, -q, q]))
    return "\n".join(lines) + "\n"


def programs(jtc, directory):
    with agent(jtc, directory) as (url, token, environment):
        package = generated(directory)
        anna, bob = Arm(package, url, token), Arm(package, url, token)

        def run_jtc(*words):
            command = [jtc, *words, "--port", url]
            return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)

        status, kept = anna.ask(
            "put_trajectory", number=3, body=anna.model("TrajectoryRequest", name="sway", text=text(0.3, 6))
        )
        assert (status, kept.points, kept.duration_s) == (200, 601, 6.0), kept
        assert anna.take("anna", lasts_s=30.0, policy="pause").held
        status, denied = bob.ask("take_lease", body=bob.model("LeaseRequest", name="bob"))
        assert status == 409 and "anna" in denied.message, denied
        status, job = anna.command("recover", body=anna.model("RecoverRequest", defaults=True))
        assert status == 202 and anna.over(job.number).stage == "finished"

        # The whole of it: run, pause, slower, on, result.
        status, job = anna.command("run", body=anna.model("RunRequest", trajectory=3))
        assert status == 202, job
        number, _ = anna.event("executing")
        while True:
            number, event = anna.event("state", number)
            if event.trajectory == "Execute":
                break
        status, _ = anna.ask("pause", lease_key=anna.key)
        assert status == 200
        while True:
            number, event = anna.event("state", number)
            if event.trajectory == "Pause":
                break
        # Others look meanwhile, from another terminal.
        shown = run_jtc("status", "--json")
        assert shown.returncode == 0 and json.loads(shown.stdout)["trajectory"] == "Pause", shown
        seen = run_jtc("monitor", "--json", "--count", "20")
        assert seen.returncode == 0 and seen.stdout.count("\n") == 20, seen
        assert anna.command("set_speed", body=anna.model("SpeedObject", percent=60))[0] == 204
        assert anna.command("resume")[0] == 204
        done = anna.over(job.number)
        assert (done.stage, done.runs) == ("finished", 1), done
        assert all(joint.max_error_mrad < 20 for joint in done.result.joints), done.result
        assert anna.command("set_speed", body=anna.model("SpeedObject", percent=100))[0] == 204

        # A second one stops it, without a lease; then the command does.
        for stop in [lambda: bob.ask("stop")[0] == 200, lambda: run_jtc("traj", "stop").returncode == 0]:
            # What somebody else has stopped is not begun again for three seconds.
            time.sleep(3.2)
            after = anna.ask("get_status")[1].last_event
            request = anna.model("RunRequest", trajectory=3, approach=True, repeat=5)
            status, job = anna.command("run", body=request)
            assert status == 202, job
            while anna.event("executing", after)[1].phase == "approach":
                after = anna.event("executing", after)[0]
            time.sleep(0.5)
            assert stop()
            assert anna.over(job.number).stage == "stopped"
        assert anna.command("release_lease")[0] == 204
        assert bob.take("bob").held
        print("generated client: lease, trajectory, run, pause, speed, resume, result, two stops, two terminals")


def requests_of_all_kinds(jtc, directory):
    for lease in (False, True):
        with agent(jtc, directory) as (url, token, _):
            command = [SCRIPTS / "schemathesis", "run", DESCRIPTION, "--url", url, "--seed", str(SEED)]
            command += ["-H", f"Authorization: Bearer {token}", "--max-examples", "30"]
            command += ["--request-timeout", "15", "--phases", "examples,coverage,fuzzing"]
            # A body of the right form may be no trajectory, and a payload no body.
            command += ["--exclude-checks", "positive_data_acceptance"]
            if lease:
                # Whoever has the lease gets further; it cannot be tried without its key then.
                body = json.dumps({"name": "everything", "lasts_s": 60.0}).encode()
                headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
                request = urllib.request.Request(f"{url}/api/lease", body, headers)
                key = json.load(urllib.request.urlopen(request))["key"]
                command += ["-H", f"Lease-Key: {key}", "--exclude-path", "/api/lease"]
            done = subprocess.run(command, capture_output=True, text=True, cwd=directory)
            assert done.returncode == 0, done.stdout[-6000:]
            print(f"Schemathesis, seed {SEED}, lease {lease}:", re.search(r"\d+ generated, .*", done.stdout)[0])


def main():
    jtc = str(pathlib.Path(sys.argv[1]).resolve())
    for check in (programs, requests_of_all_kinds):
        with tempfile.TemporaryDirectory() as directory:
            check(jtc, pathlib.Path(directory))


if __name__ == "__main__":
    main()
