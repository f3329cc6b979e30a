"""Checks `ucom serve --sim` with clients that know only the agent's address and docs/ucom-openapi.json.

usage: check_ucom_api.py UCOM

openapi-python-client generates a first client from the description, and Schemathesis builds a second one from the same file. The first
takes the lease, numbers the chain, runs boards, sets an input, waits until the axis has arrived, and updates a board. Another client stops
all boards without a lease. The second sends valid and invalid requests of all kinds, with and without a lease, and compares every answer
with the description. Needs openapi-python-client and schemathesis.
"""

import base64
import time

import served

DESCRIPTION = "ucom-openapi.json"


def agent(ucom, directory):
    return served.serving(ucom, directory, "--boards", "2")


class Chain(served.Generated):
    """The generated client, extended by jobs for boards."""

    def job(self, operation, **values):
        """Runs a job and returns it after its end."""
        status, job = self.command(operation, **values)
        assert status == 202, (operation, status, job)
        return self.over(job.number)


def programs(ucom, directory):
    with agent(ucom, directory) as chain:
        package = served.generated(DESCRIPTION, directory, "chain_client")
        anna, bob = Chain(package, chain), Chain(package, chain)
        assert anna.take("anna", lasts_s=60.0, policy="stop").held
        status, denied = bob.ask("take_lease", body=bob.model("LeaseRequest", name="bob"))
        assert status == 409 and "anna" in denied.message, denied
        job = anna.job("init", body=anna.model("InitRequest"))
        assert job.stage == "finished" and [board.number for board in job.chain.boards] == [1, 2], job

        # Runs the control loops and sets an input by its name. The axis moves there; positions are in hundredths of a degree.
        job = anna.job("run", body=anna.model("RunRequest", boards=[1, 2], active=True))
        assert job.stage == "finished" and all(board.active for board in job.run.boards), job
        status, sent = anna.command("set_input", number=1, name="set_position", body=anna.model("ValueRequest", value=1500))
        assert (status, sent.value) == (200, 1500), sent
        end = time.monotonic() + served.PATIENCE_S
        while True:
            status, values = bob.ask("get_values", number=1)
            assert status == 200
            position = next(value.value for value in values.outputs if value.name.startswith("position"))
            if abs(position - 1500) < 30:
                assert not values.stale
                break
            assert time.monotonic() < end, position
            time.sleep(0.05)

        # Another client stops all boards without a lease.
        status, stopped = bob.ask("stop")
        assert status == 200, stopped
        _, event = bob.event("stopped", stopped.last_event)
        assert event.boards == [1, 2] and event.not_stopped == [], event
        status, boards = bob.ask("list_boards")
        assert [board.state for board in boards] == ["exloader", "exloader"], boards

        # Updates a board. The protocol page gives the checksum of the image.
        image = base64.b64encode(bytes((37 * i + 11) % 256 for i in range(1000))).decode()
        request = anna.model("UpdateRequest", boards=[{"board": 2}], image=image, format="bin")
        # After another client's Stop, requests that begin something are refused for three seconds.
        time.sleep(3.2)
        job = anna.job("update", body=request)
        assert job.stage == "finished", job
        assert [(b.outcome, b.verified, b.program_id_after) for b in job.update.boards] == [("verified", True, 0x4B3F)]
        assert anna.command("release_lease")[0] == 204
        assert bob.take("bob").held
        print("generated client: lease, numbers, control loops, an input, a stop by another, an update")


def requests_of_all_kinds(ucom, directory):
    served.requests_of_all_kinds(DESCRIPTION, 15, lambda: agent(ucom, directory), directory)


if __name__ == "__main__":
    served.run(programs, requests_of_all_kinds)
