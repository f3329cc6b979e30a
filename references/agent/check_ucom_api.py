"""A program that has nothing of ours but the agent's address and docs/ucom-openapi.json, against `ucom serve --sim`.

usage: check_ucom_api.py UCOM

A client is generated from the description by openapi-python-client, and a second one is put together by Schemathesis from the same file:
the first takes the lease, numbers the chain, runs boards, gives an input and waits until the axis is there, updates a board, and another
one stops all of them without a lease; the second sends requests of all kinds, right and wrong, with and without a lease, and compares
every answer with the description. Needs openapi-python-client and schemathesis.
"""

import base64
import contextlib
import importlib
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import urllib.request

DESCRIPTION = pathlib.Path(__file__).parents[2] / "docs" / "ucom-openapi.json"
SCRIPTS = pathlib.Path(sys.executable).parent
SEED = 20261123
PATIENCE_S = 60.0


@contextlib.contextmanager
def agent(ucom, directory):
    """`ucom serve --sim`, with its own folders; its address and its operator's token."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("UCOM_")}
    environment |= {"XDG_STATE_HOME": str(directory / "state"), "XDG_CACHE_HOME": str(directory / "cache")}
    command = [ucom, "--json", "serve", "--sim", "--boards", "2", "--listen", "127.0.0.1:0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=directory)
    try:
        ready = json.loads(process.stdout.readline())
        assert ready["simulated"] is True
        token = re.search('^operator = "(.*)"', pathlib.Path(ready["token_file"]).read_text(), re.M)[1]
        yield ready["url"], token
    finally:
        process.terminate()
        assert process.wait(20) == 0


def generated(directory):
    """The client that openapi-python-client makes of the description."""
    command = [SCRIPTS / "openapi-python-client", "generate", "--path", DESCRIPTION, "--meta", "none"]
    path = f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        [*command, "--output-path", directory / "chain_client", "--fail-on-warning"],
        check=True,
        env=os.environ | {"PATH": path},
        stdout=subprocess.DEVNULL,
    )
    sys.path.insert(0, str(directory))
    return importlib.import_module("chain_client")


class Chain:
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

    def job(self, operation, **values):
        """A job when it is over."""
        status, job = self.command(operation, **values)
        assert status == 202, (operation, status, job)
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            status, job = self.ask("get_job", number=job.number)
            assert status == 200
            if job.stage != "running":
                return job
            time.sleep(0.1)
        raise AssertionError(f"job {job.number} is not over")

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
        raise AssertionError(f"no {kind} behind {after}")


def programs(ucom, directory):
    with agent(ucom, directory) as (url, token):
        package = generated(directory)
        anna, bob = Chain(package, url, token), Chain(package, url, token)
        assert anna.take("anna", lasts_s=60.0, policy="stop").held
        status, denied = bob.ask("take_lease", body=bob.model("LeaseRequest", name="bob"))
        assert status == 409 and "anna" in denied.message, denied
        job = anna.job("init", body=anna.model("InitRequest"))
        assert job.stage == "finished" and [board.number for board in job.chain.boards] == [1, 2], job

        # Control loops, an input by its name, and the axis that goes there: hundredths of a degree.
        job = anna.job("run", body=anna.model("RunRequest", boards=[1, 2], active=True))
        assert job.stage == "finished" and all(board.active for board in job.run.boards), job
        status, sent = anna.command("set_input", number=1, name="set_position", body=anna.model("ValueRequest", value=1500))
        assert (status, sent.value) == (200, 1500), sent
        end = time.monotonic() + PATIENCE_S
        while True:
            status, values = bob.ask("get_values", number=1)
            assert status == 200
            position = next(value.value for value in values.outputs if value.name.startswith("position"))
            if abs(position - 1500) < 30:
                assert not values.stale
                break
            assert time.monotonic() < end, position
            time.sleep(0.05)

        # Somebody else stops all of them, without a lease.
        status, stopped = bob.ask("stop")
        assert status == 200, stopped
        _, event = bob.event("stopped", stopped.last_event)
        assert event.boards == [1, 2] and event.not_stopped == [], event
        status, boards = bob.ask("list_boards")
        assert [board.state for board in boards] == ["exloader", "exloader"], boards

        # An update, by the checksum of the protocol's page.
        image = base64.b64encode(bytes((37 * i + 11) % 256 for i in range(1000))).decode()
        request = anna.model("UpdateRequest", boards=[{"board": 2}], image=image, format="bin")
        job = anna.job("update", body=request)
        assert job.stage == "finished", job
        assert [(b.outcome, b.verified, b.program_id_after) for b in job.update.boards] == [("verified", True, 0x4B3F)]
        assert anna.command("release_lease")[0] == 204
        assert bob.take("bob").held
        print("generated client: lease, numbers, control loops, an input, a stop by another, an update")


def requests_of_all_kinds(ucom, directory):
    for lease in (False, True):
        with agent(ucom, directory) as (url, token):
            command = [SCRIPTS / "schemathesis", "run", DESCRIPTION, "--url", url, "--seed", str(SEED)]
            command += ["-H", f"Authorization: Bearer {token}", "--max-examples", "15"]
            command += ["--request-timeout", "15", "--phases", "examples,coverage,fuzzing"]
            # A body of the right form may be no image, and a number that of no board.
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
    ucom = str(pathlib.Path(sys.argv[1]).resolve())
    for check in (programs, requests_of_all_kinds):
        with tempfile.TemporaryDirectory() as directory:
            check(ucom, pathlib.Path(directory))


if __name__ == "__main__":
    main()
