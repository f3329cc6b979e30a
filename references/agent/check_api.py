"""Checks `jtc serve --sim` with clients that know only the agent's address and docs/openapi.json.

usage: check_api.py JTC

openapi-python-client generates a first client from the description, and Schemathesis builds a second one from the same file. The first
takes the lease, stores a trajectory, runs it, pauses, resumes and reads the result. Meanwhile another client stops it, and the commands
`jtc status`, `jtc monitor` and `jtc traj stop` read and stop it from another terminal. The second sends valid and invalid requests of all
kinds, and compares every answer with the description. Needs openapi-python-client and schemathesis.
"""

import contextlib
import json
import subprocess
import time
import urllib.error
import urllib.request

import served

DESCRIPTION = "openapi.json"
# Baud rate at which a log arrives within the time that a request of Schemathesis may take.
RATE = "3000000"
# First and last bytes of an MCAP recording.
MCAP = b"\x89MCAP0\r\n"


def programs(jtc, directory):
    with served.serving(jtc, directory) as agent:
        package = served.generated(DESCRIPTION, directory, "arm_client")
        anna, bob = served.Generated(package, agent), served.Generated(package, agent)

        def run_jtc(*words):
            command = [jtc, *words, "--port", agent.url]
            return subprocess.run(command, capture_output=True, text=True, env=agent.environment, timeout=60)

        status, kept = anna.ask(
            "put_trajectory", number=3, body=anna.model("TrajectoryRequest", name="sway", text=served.sway(0.3, 6))
        )
        assert (status, kept.points, kept.duration_s) == (200, 601, 6.0), kept
        assert anna.take("anna", lasts_s=30.0, policy="pause").held
        status, denied = bob.ask("take_lease", body=bob.model("LeaseRequest", name="bob"))
        assert status == 409 and "anna" in denied.message, denied
        status, job = anna.command("recover", body=anna.model("RecoverRequest", defaults=True))
        assert status == 202 and anna.over(job.number, renewing=True).stage == "finished"

        # Runs the arm, pauses it, reduces the speed, resumes, and reads the result.
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
        # Meanwhile other clients read from another terminal.
        shown = run_jtc("status", "--json")
        assert shown.returncode == 0 and json.loads(shown.stdout)["trajectory"] == "Pause", shown
        seen = run_jtc("monitor", "--json", "--count", "20")
        assert seen.returncode == 0 and seen.stdout.count("\n") == 20, seen
        assert anna.command("set_speed", body=anna.model("SpeedObject", percent=60))[0] == 204
        assert anna.command("resume")[0] == 204
        done = anna.over(job.number, renewing=True)
        assert (done.stage, done.runs) == ("finished", 1), done
        assert all(joint.max_error_mrad < 20 for joint in done.result.joints), done.result
        assert anna.command("set_speed", body=anna.model("SpeedObject", percent=100))[0] == 204

        # A second client stops the arm without a lease. Then the command stops it.
        for stop in [lambda: bob.ask("stop")[0] == 200, lambda: run_jtc("traj", "stop").returncode == 0]:
            # After another client's Stop, motion requests are refused for three seconds.
            time.sleep(3.2)
            shown = anna.ask("get_status")[1]
            after = shown.last_event
            request = anna.model("RunRequest", trajectory=3, approach=True, repeat=5)
            # A request made before a Stop moves nothing, whatever its delay.
            status, denied = anna.command("run", body=request, asked_after=shown.last_halt - 1)
            assert status == 409 and denied.code == "denied", denied
            status, job = anna.command("run", body=request, asked_after=shown.last_halt)
            assert status == 202, job
            while anna.event("executing", after)[1].phase == "approach":
                after = anna.event("executing", after)[0]
            time.sleep(0.5)
            assert stop()
            assert anna.over(job.number, renewing=True).stage == "stopped"
        assert anna.command("release_lease")[0] == 204
        assert bob.take("bob").held
        print("generated client: lease, trajectory, run, pause, speed, resume, result, two stops, two terminals")


def everything_else(jtc, directory):
    """Checks the requests that are not motions: settings, disabled joints, flight recorder, arm, plans."""
    # Reading the log of the flight recorder takes long on a slow line.
    with served.serving(jtc, directory, "--baud", RATE) as agent:
        anna = served.Generated(served.generated(DESCRIPTION, directory, "whole_arm_client"), agent)
        assert anna.take("anna", lasts_s=60.0).held

        def setting(name, joint=None):
            status, settings = anna.ask("get_settings")
            assert status == 200
            (found,) = [one for one in settings if one.name == name and (getattr(one, "joint", None) or None) == joint]
            return found

        def change(*changes):
            settings = [dict(zip(("name", "value", "joint"), one)) for one in changes]
            return anna.command("set_settings", body=anna.model("SettingsRequest", settings=settings))

        assert setting("stop_ms").high == 10000
        assert change(("stop_ms", 400), ("velocity_max_rad_s", 1.25, 4))[0] == 204
        assert setting("stop_ms").value == 400 and setting("velocity_max_rad_s", 4).value == 1.25
        status, denied = change(("stop_ms", 300), ("ramp_ms", 1))
        assert (status, denied.value, denied.limit) == (422, 1, 20) and setting("stop_ms").value == 400, denied

        for absent in ([{"joint": 5, "position_rad": 0.25}], []):
            assert anna.command("set_absent", body=anna.model("AbsentObject", absent=absent))[0] == 204
            status, found = anna.ask("get_absent")
            assert (status, found.to_dict()) == (200, {"absent": absent}), found

        # Pushes the present arm, the same arm under another name, and the original arm again.
        status, arm = anna.ask("get_arm")
        assert status == 200 and arm.hash_ == anna.ask("get_info")[1].hash_
        for text in (arm.text.replace('name = "avena"', 'name = "other"', 1), arm.text):
            status, job = anna.command("put_arm", body=anna.model("ArmRequest", text=text, store=True))
            assert status == 202, job
            done = anna.over(job.number, renewing=True)
            assert done.stage == "finished" and len(done.given.parts) == 3, done
            assert anna.ask("get_arm")[1].text == text
        status, denied = anna.command("put_arm", body=anna.model("ArmRequest", text=arm.text[:1000]))
        assert status == 422 and anna.ask("get_arm")[1].text == arm.text, denied

        # The motion is planned, stored and run. Afterwards the flight recorder contains it.
        status, job = anna.command("recover", body=anna.model("RecoverRequest", defaults=True))
        assert status == 202 and anna.over(job.number, renewing=True).stage == "finished"
        way = "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.3,-0.2,0.2,0,0,0\n0,0,0,0,0,0.2\n"
        keep = {"number": 9, "name": "bow"}
        status, plan = anna.ask("plan", body=anna.model("PlanRequest", waypoints=way, blend_rad=0.02, keep=keep))
        assert status == 200 and plan.kept.number == 9 and plan.binding and plan.waypoint_times_s[1] > 0, plan
        status, job = anna.command("run", body=anna.model("RunRequest", trajectory=9))
        assert status == 202 and anna.over(job.number, renewing=True).stage == "finished"
        assert anna.ask("get_log_status")[1].state == "recording"
        # Reading the log stops the recording, so only operators may do that.
        asked = urllib.request.Request(f"{agent.url}/api/log")
        with contextlib.suppress(urllib.error.HTTPError):
            urllib.request.urlopen(asked, timeout=60).close()
            raise AssertionError("it is read without a token")
        asked.add_header("Authorization", f"Bearer {agent.tokens['operator']}")
        with urllib.request.urlopen(asked, timeout=60) as response:
            log = response.read()
        # The magic bytes of the format are at both ends.
        assert log.startswith(MCAP) and log.endswith(MCAP), log[:20]
        path = directory / "log.mcap"
        path.write_bytes(log)
        replayed = subprocess.run([jtc, "--json", "log", "replay", path], capture_output=True, text=True, timeout=60)
        assert replayed.returncode == 0 and json.loads(replayed.stdout)["replayed"] > 1000, replayed
        assert anna.command("clear_log")[0] == 204
        print("generated client: settings, absent joints, arm, plan, flight recorder")


def requests_of_all_kinds(jtc, directory):
    served.requests_of_all_kinds(DESCRIPTION, 30, lambda: served.serving(jtc, directory, "--baud", RATE), directory)


if __name__ == "__main__":
    served.run(programs, everything_else, requests_of_all_kinds)
