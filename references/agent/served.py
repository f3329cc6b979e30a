"""Shared code of the agents' checks: a served arm or chain for one `with` block, and clients that know only its HTTP API.

`run` calls the checks of a script, and `serving` starts an agent for one of them. `Requests` sends requests by method and path, and
`Generated` uses the client that openapi-python-client makes from the agent's description. Schemathesis sends all other requests
(`requests_of_all_kinds`).
"""

import contextlib
import dataclasses
import importlib
import json
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

DOCS = pathlib.Path(__file__).resolve().parents[2] / "docs"
SCRIPTS = pathlib.Path(sys.executable).parent
SEED = 20261123
PATIENCE_S = 60.0
# Time from the request to end until the agent has ended.
ENDING_S = 20.0


def run(*checks):
    """Calls each check with the program from the command line and with a separate empty folder."""
    # A terminated script leaves its `with` blocks, which end the agents that it has started.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("terminated"))
    program = pathlib.Path(sys.argv[1]).resolve()
    for check in checks:
        with tempfile.TemporaryDirectory() as directory:
            check(program, pathlib.Path(directory))


@dataclasses.dataclass(frozen=True)
class Agent:
    """A running agent."""

    # Output of the agent up to the time when it was ready.
    ready: dict
    # Tokens by role.
    tokens: dict
    # Environment for commands that must find the same folders.
    environment: dict

    @property
    def url(self):
        return self.ready["url"]


@contextlib.contextmanager
def serving(program, directory, *options):
    """Runs `PROGRAM serve --sim` as an `Agent` on a free port, with its folders below `directory`. The agent ends with the block,
    even if the block fails."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("JTC_", "UCOM_"))}
    for name in ("state", "run", "cache"):
        (directory / name).mkdir(exist_ok=True)
    environment |= {
        "XDG_STATE_HOME": str(directory / "state"),
        "XDG_RUNTIME_DIR": str(directory / "run"),
        "XDG_CACHE_HOME": str(directory / "cache"),
    }
    command = [program, "--json", "serve", "--sim", "--listen", "127.0.0.1:0", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=directory) as process:
        try:
            ready = json.loads(process.stdout.readline())
            assert ready["simulated"] is True, ready
            text = pathlib.Path(ready["token_file"]).read_text()
            yield Agent(ready, dict(re.findall(r'^(\w+) = "(.*)"', text, re.M)), environment)
        finally:
            process.terminate()
            try:
                ended = process.wait(ENDING_S)
            finally:
                # Kills the agent if it has not ended.
                process.kill()
            assert ended == 0, f"the agent ended with {ended}"


def over(ask, number):
    """Waits for the end of the job with this number and returns the job. `ask` returns the present stage and the job."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        stage, job = ask()
        if stage != "running":
            return job
        time.sleep(0.1)
    raise AssertionError(f"job {number} is not over")


class Requests:
    """Sends requests to an agent by method and path, with a token and, once `key` is set, with a lease."""

    def __init__(self, url, token):
        self.url, self.token, self.key = url, token, None

    def ask(self, method, path, body=None, **headers):
        """Returns status, text and headers of the answer."""
        data = None if body is None else json.dumps(body).encode()
        headers |= {"Content-Type": "application/json"} if data else {}
        headers |= {"Authorization": f"Bearer {self.token}"} if self.token else {}
        headers |= {"Lease-Key": self.key} if self.key else {}
        request = urllib.request.Request(self.url + path, data, headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=20) as response:
                return response.status, response.read().decode(), response.headers
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode(), error.headers

    def json(self, method, path, body=None):
        """Returns the body of the answer to a request that must succeed."""
        status, text, _ = self.ask(method, path, body)
        assert status < 300, (method, path, status, text)
        return json.loads(text) if text else None

    def over(self, number):
        """Waits for the end of a job and returns its stage."""

        def ask():
            stage = self.json("GET", f"/api/jobs/{number}")["stage"]
            return stage, stage

        return over(ask, number)

    @contextlib.contextmanager
    def renewing(self):
        """Renews the lease within the block, even on a busy computer."""
        done = threading.Event()

        def renew():
            while not done.wait(5):
                self.json("PUT", "/api/lease")

        thread = threading.Thread(target=renew)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()


def generated(description, directory, name):
    """Returns the client that openapi-python-client makes from a description in docs/. It is imported as a package
    of this name, which is written below `directory`."""
    command = [SCRIPTS / "openapi-python-client", "generate", "--path", DOCS / description, "--meta", "none"]
    path = f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        [*command, "--output-path", directory / name, "--fail-on-warning"],
        check=True,
        env=os.environ | {"PATH": path},
        stdout=subprocess.DEVNULL,
    )
    sys.path.insert(0, str(directory))
    return importlib.import_module(name)


class Generated:
    """A generated client with the operator's token, and the arguments of every request."""

    def __init__(self, package, agent):
        client = importlib.import_module(f"{package.__name__}.client")
        self.package = package
        self.client = client.AuthenticatedClient(base_url=agent.url, token=agent.tokens["operator"], timeout=20)
        self.key = None

    def model(self, kind, **values):
        """Returns a body of a type in the description."""
        return getattr(importlib.import_module(f"{self.package.__name__}.models"), kind).from_dict(values)

    def ask(self, operation, **values):
        """Returns status and parsed body of an operation."""
        module = importlib.import_module(f"{self.package.__name__}.api.default.{operation}")
        response = module.sync_detailed(client=self.client, **values)
        return int(response.status_code), response.parsed

    def command(self, operation, **values):
        """Like `ask`, with the key of the lease."""
        return self.ask(operation, lease_key=self.key, **values)

    def take(self, name, **values):
        """Takes the lease, which later commands use. Returns the answer of the agent."""
        status, grant = self.ask("take_lease", body=self.model("LeaseRequest", name=name, **values))
        assert status == 200, grant
        self.key = grant.key
        return grant

    def over(self, number, renewing=False):
        """Waits for the end of a job and returns the job. If the job takes longer than the lease, use `renewing`."""

        def ask():
            status, job = self.ask("get_job", number=number)
            assert status == 200
            if renewing and self.key and job.stage == "running":
                self.command("renew_lease")
            return job.stage, job

        return over(ask, number)

    def event(self, kind, after=0):
        """Returns number and contents of the first event of this kind after a number. Checks that no number is left out."""
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


def requests_of_all_kinds(description, examples, serve, directory):
    """Sends Schemathesis' requests for a description in docs/ to an agent that `serve` starts, with and without a lease.

    Every answer is compared with the description; `examples` is the largest number of generated requests per operation.
    """
    for lease in (False, True):
        with serve() as agent:
            token = agent.tokens["operator"]
            command = [SCRIPTS / "schemathesis", "run", DOCS / description, "--url", agent.url, "--seed", str(SEED)]
            command += ["-H", f"Authorization: Bearer {token}", "--max-examples", str(examples)]
            command += ["--request-timeout", "15", "--phases", "examples,coverage,fuzzing"]
            # A well-formed body may be refused for its contents: no trajectory, no image, no payload of a body, no board with this
            # number.
            command += ["--exclude-checks", "positive_data_acceptance"]
            if lease:
                # Requests with the lease reach more code. The requests of the lease itself are excluded, because their key is not known to
                # Schemathesis.
                grant = Requests(agent.url, token).json("POST", "/api/lease", {"name": "everything", "lasts_s": 60.0})
                command += ["-H", f"Lease-Key: {grant['key']}", "--exclude-path", "/api/lease"]
            done = subprocess.run(command, capture_output=True, text=True, cwd=directory)
            assert done.returncode == 0, done.stdout[-6000:]
            print(f"Schemathesis, seed {SEED}, lease {lease}:", re.search(r"\d+ generated, .*", done.stdout)[0])


def sway(amplitude, seconds):
    """Returns the text of a trajectory: all joints move there and back, with rest at both ends and a point every 10 ms. Uses no code of
    the project."""
    lines = ["t," + ",".join(f"q{j}" for j in range(1, 7))]
    steps = round(100 * seconds)
    for n in range(steps + 1):
        x = n / steps
        way = x - math.sin(2 * math.pi * x) / (2 * math.pi)
        q = amplitude * 0.5 * (1 - math.cos(2 * math.pi * way))
        lines.append(",".join(f"{v:.9f}" for v in [n / 100, q, -q, q, q, -q, q]))
    return "\n".join(lines) + "\n"
