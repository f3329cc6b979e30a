"""Checks `jtc serve --sim` with programs of other projects: a reader of Prometheus' text format, and a client of the Foxglove WebSocket
protocol that was written from its specification only.

usage: check_metrics.py JTC

The metrics are compared with `/api/status` and with the actions of this script. The messages on the Foxglove channels are decoded with
the schemas that came with them and compared in the same way, at rest and in motion. A client that never reads does not disturb another
client and is disconnected. Pages of allowed origins have read-only access. Needs prometheus-client, websockets and mcap-ros2-support.
"""

import asyncio
import contextlib
import json
import math
import pathlib
import re
import struct
import time
import types
import xml.etree.ElementTree

import mcap_ros2.decoder
import prometheus_client.parser
import websockets
from websockets.asyncio.client import connect

import served

ORIGIN = "https://app.example"
NAMES = ["foxglove.websocket.v1", "foxglove.sdk.v1"]
# A client that never reads is disconnected after 10 s without a pong. On a slow computer this takes longer.
GONE_S = 60.0


class Agent(served.Requests):
    """Sends requests to an agent, and reads its metrics."""

    def metrics(self):
        """Returns samples by name and labels, as Prometheus would store them."""
        status, text, headers = self.ask("GET", "/metrics")
        assert status == 200 and headers["Content-Type"].startswith("text/plain; version=0.0.4"), (status, headers)
        found = {}
        for family in prometheus_client.parser.text_string_to_metric_families(text):
            assert family.type in ("gauge", "counter"), family
            assert family.name.startswith("jtc_") and family.documentation, family
            for sample in family.samples:
                key = (sample.name, *sorted(sample.labels.items()))
                assert key not in found, key
                assert sample.name.endswith("_total") == (family.type == "counter"), sample
                found[key] = sample.value
        return found


def states(metrics, name):
    return {dict(key[1:])["state"]: value for key, value in metrics.items() if key[0] == name}


def check_metrics(arm):
    """Compares every metric that another interface also shows."""
    for _ in range(20):
        status = arm.json("GET", "/api/status")
        metrics = arm.metrics()
        again = arm.json("GET", "/api/status")
        # Skips samples if a path ended and was sent again between them.
        (before, point), (after, then) = [(s["controller"]["trajectory"], s["controller"]["point"]) for s in (status, again)]
        if before == after and point <= then:
            break
    for joint, then in zip(status["controller"]["joints"], again["controller"]["joints"], strict=True):
        label = ("joint", str(joint["joint"]))
        for name, key, within in [
            ("jtc_joint_position_radians", "position_rad", 1e-3),
            ("jtc_joint_velocity_radians_per_second", "velocity_rad_s", 1e-2),
            ("jtc_joint_temperature_celsius", "temperature_c", 1.0),
        ]:
            low, high = sorted([joint[key], then[key]])
            assert low - within <= metrics[name, label] <= high + within, (name, label, metrics[name, label], low, high)
        for share in ("position", "velocity", "torque"):
            assert 0 <= metrics[f"jtc_joint_{share}_limit_ratio", label] < 1.5, (share, label)
    controller = states(metrics, "jtc_controller_state")
    assert controller[status["controller"]["state"]] == 1 and sum(controller.values()) == 1, controller
    trajectory = states(metrics, "jtc_trajectory_state")
    assert trajectory[status["controller"]["trajectory"]] == 1 and sum(trajectory.values()) == 1, trajectory
    assert 0 <= metrics[("jtc_status_age_seconds",)] < 5
    assert metrics[("jtc_lease_held",)] == ("lease" in status)
    assert metrics[("jtc_clients",)] == status["clients"]
    assert metrics[("jtc_port_lost",)] == 0
    assert metrics[("jtc_controller_errors",)] == len(status["controller"]["errors"])
    assert status["last_event"] <= metrics[("jtc_events_total",)] <= again["last_event"]
    info = arm.json("GET", "/api/info")
    (identity,) = [dict(key[1:]) for key in metrics if key[0] == "jtc_controller_info"]
    assert identity == {key: info[key] for key in ("firmware", "revision", "board", "arm")}, (identity, info)
    (build,) = [dict(key[1:]) for key in metrics if key[0] == "jtc_build_info"]
    assert build["simulated"] == "true" and re.fullmatch(r"\d+\.\d+\.\d+.*", build["version"]), build
    return metrics


class Viewer:
    """A client of the Foxglove WebSocket protocol, version 1."""

    def __init__(self, socket):
        self.socket, self.channels, self.services, self.info = socket, {}, {}, None
        self.subscribed, self.decoders, self.answers, self.warnings = {}, {}, {}, []
        self.next, self.left = 1, set()

    @classmethod
    async def greeted(cls, socket, services=True):
        self = cls(socket)
        while not (self.channels and (self.services or not services)):
            await self.take()
        return self

    async def take(self):
        """Returns the next message: topic, timestamp in ns, decoded contents; `None` for a message of another kind."""
        message = await asyncio.wait_for(self.socket.recv(), 20)
        if isinstance(message, str):
            message = json.loads(message)
            match message["op"]:
                case "serverInfo":
                    assert self.info is None and not self.channels, "the first message"
                    self.info = message
                case "advertise":
                    assert self.info is not None
                    self.channels |= {channel["topic"]: channel for channel in message["channels"]}
                case "advertiseServices":
                    self.services |= {service["name"]: service for service in message["services"]}
                case "status":
                    self.warnings.append(message)
                case "serviceCallFailure":
                    self.answers[message["callId"]] = message["message"]
                case other:
                    raise AssertionError(other)
            return None
        if message[0] == 3:
            service, call, length = struct.unpack_from("<III", message, 1)
            assert message[13 : 13 + length] == b"json"
            self.answers[call] = json.loads(message[13 + length :])
            return None
        assert message[0] == 1, message[0]
        subscription, stamp = struct.unpack_from("<IQ", message, 1)
        if subscription in self.left:
            # The message was sent before the agent received the end of the subscription.
            return None
        topic = self.subscribed[subscription]
        return topic, stamp, self.decode(self.channels[topic], message[13:])

    def decode(self, channel, payload):
        if channel["encoding"] == "json":
            assert channel["schemaEncoding"] == "jsonschema"
            schema, value = json.loads(channel["schema"]), json.loads(payload)
            assert set(value) == set(schema["properties"]), value
            return value
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        if channel["id"] not in self.decoders:
            schema = types.SimpleNamespace(
                id=channel["id"],
                name=channel["schemaName"],
                encoding="ros2msg",
                data=channel["schema"].encode(),
            )
            self.decoders[channel["id"]] = mcap_ros2.decoder.DecoderFactory().decoder_for("cdr", schema)
        return self.decoders[channel["id"]](payload)

    async def subscribe(self, *topics):
        new = []
        for topic in topics:
            self.subscribed[self.next] = topic
            new.append({"id": self.next, "channelId": self.channels[topic]["id"]})
            self.next += 1
        await self.socket.send(json.dumps({"op": "subscribe", "subscriptions": new}))

    async def unsubscribe(self, topic):
        (number,) = [number for number, of in self.subscribed.items() if of == topic]
        self.left.add(number)
        del self.subscribed[number]
        await self.socket.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [number]}))

    async def call(self, service, call):
        number = self.services[service]["id"] if isinstance(service, str) else service
        await self.socket.send(struct.pack("<BIII", 2, number, call, 4) + b"json{}")
        while call not in self.answers:
            await self.take()
        return self.answers[call]

    async def until(self, topic, wanted=lambda value: True):
        end = time.monotonic() + served.PATIENCE_S
        while time.monotonic() < end:
            taken = await self.take()
            if taken and taken[0] == topic and wanted(taken[2]):
                return taken[2]
        raise AssertionError(f"no such message on {topic}")


def socket(url, path="/", token=None, origin=None, **options):
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    address = url.replace("http://", "ws://") + path
    options |= {"subprotocols": options.get("subprotocols", NAMES), "max_size": None, "compression": None}
    return connect(address, additional_headers=headers, origin=origin, **options)


async def check_channels(arm):
    """Compares each channel with /api/status, with an arm at rest."""
    for path, names in [("/", NAMES), ("/api/foxglove", NAMES[1:]), ("/", NAMES[:1])]:
        async with socket(arm.url, path, subprotocols=names) as ws:
            assert ws.subprotocol in names
            viewer = await Viewer.greeted(ws)
            assert viewer.info["capabilities"] == ["services"] and viewer.info["supportedEncodings"] == ["json"]
    async with socket(arm.url) as ws:
        viewer = await Viewer.greeted(ws)
        topics = ["/joint_states", "/joint_commands", "/jtc/control", "/jtc/state", "/robot_description", "/tf", "/jtc/status"]
        assert list(viewer.channels) == topics, list(viewer.channels)
        await viewer.subscribe(*topics)
        seen, stamps = {}, []
        end = time.monotonic() + 5
        while time.monotonic() < end:
            if taken := await viewer.take():
                topic, stamp, value = taken
                assert abs(stamp * 1e-9 - time.time()) < 10
                seen.setdefault(topic, []).append(value)
                stamps.append((topic, stamp))
        joints = arm.json("GET", "/api/status")["controller"]["joints"]
        assert "/joint_commands" not in seen, "nobody has commanded anything"
        assert len(seen["/robot_description"]) == 1, "the description is sent once"
        # At most 25 messages per second; the arm reports at least as often.
        count = len(seen["/joint_states"])
        assert 20 <= count <= 5 * 25 + 2, count
        of_states = [stamp for topic, stamp in stamps if topic == "/joint_states"]
        assert of_states == sorted(set(of_states))
        urdf = xml.etree.ElementTree.fromstring(seen["/robot_description"][0].data)
        links = [link.get("name") for link in urdf.iter("link")]
        names = [joint.get("name") for joint in urdf.iter("joint") if joint.get("type") == "revolute"]
        last = seen["/joint_states"][-1]
        assert list(last.name) == names
        for value, joint in zip(last.position, joints, strict=True):
            assert abs(value - joint["position_rad"]) < 1e-3, (list(last.position), joints)
        # The parent of each link is in the description, and the chain is complete.
        transforms = seen["/tf"][-1].transforms
        assert [t.child_frame_id for t in transforms] == links[1:]
        assert [t.header.frame_id for t in transforms] == links[:-1]
        for t in transforms:
            q = t.transform.rotation
            assert abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 1e-9
        words = seen["/jtc/status"][-1]
        assert words["state"] == "HoldPos" and words["simulated"] and words["errors"] == [], words
        assert seen["/jtc/state"][-1].state == 2
        assert [round(t) for t in seen["/jtc/control"][-1].temperature] == [j["temperature_c"] for j in joints]
        # A second subscription receives only the requested topics.
        for topic in topics:
            await viewer.unsubscribe(topic)
        await viewer.subscribe("/robot_description")
        assert (await viewer.until("/robot_description")).data == seen["/robot_description"][0].data
        # Invalid messages are refused with a reason, and the connection stays open.
        for wrong in ["{", "[]", '{"op":"subscribe","subscriptions":[{"id":9,"channelId":99}]}', '{"op":"fetchAsset"}']:
            before = len(viewer.warnings)
            await ws.send(wrong)
            while len(viewer.warnings) == before:
                await viewer.take()
        assert await viewer.call(77, 5) == "service 77 does not exist"
        print(f"channels: {', '.join(topics)}; {count} messages of joints in 5 s, as /api/status has them")


async def check_motion(arm):
    """Checks an arm in motion: commanded and measured positions, a client that never reads, a pause and a stop."""
    number = arm.json("POST", "/api/runs", {"trajectory": 3, "repeat": 50})["number"]
    async with socket(arm.url) as ws, socket(arm.url, ping_interval=None, max_queue=1) as deaf:
        viewer = await Viewer.greeted(ws)
        # This client subscribes to all channels and then reads no more.
        channels = (await Viewer.greeted(deaf)).channels.values()
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
        deaf.transport.pause_reading()
        await deaf.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        await viewer.subscribe("/joint_states", "/joint_commands", "/jtc/status")
        measured, errors, moved, gaps, last = None, [], set(), [], time.monotonic()
        end = time.monotonic() + 20
        while time.monotonic() < end:
            taken = await viewer.take()
            if taken and taken[0] == "/joint_states":
                measured = taken[1], list(taken[2].position)
                moved.add(round(measured[1][0], 2))
                now = time.monotonic()
                gaps.append(now - last)
                last = now
            if taken and taken[0] == "/joint_commands" and measured and measured[0] == taken[1]:
                known = [pair for pair in zip(measured[1], taken[2].position, strict=True) if math.isfinite(pair[1])]
                errors += [abs(a - b) for a, b in known]
        assert len(moved) > 20, "the arm moves"
        assert len(errors) > 300 and max(errors) < 0.02, (len(errors), max(errors, default=None))
        check_metrics(arm)
        assert max(gaps) < 3, "the one that reads is not disturbed"
        # This is in the middle of the path, and not while it is sent again.
        await viewer.until("/jtc/status", lambda words: words["trajectory"] == "Execute" and 1000 < words["point"] < 3000)
        halt = await viewer.call("pause", 1)
        assert halt["sent"] == "pause"
        await viewer.until("/jtc/status", lambda words: words["trajectory"] == "Pause")
        assert (await viewer.call("stop", 2)) == {"sent": "stop", "halt": halt["halt"] + 1}
        assert await asyncio.to_thread(arm.over, number) == "stopped"
        # The client that does not read is disconnected, although the system buffers some data for it.
        end = time.monotonic() + GONE_S
        while arm_sockets(arm.url) > 1 and time.monotonic() < end:
            await viewer.take()
        assert arm_sockets(arm.url) == 1, "the one that never reads is there still"
        deaf.transport.resume_reading()
        kept = 0
        with contextlib.suppress(websockets.ConnectionClosed):
            while await asyncio.wait_for(deaf.recv(), 10):
                kept += 1
        assert kept < 7 * 25 * 5, f"{kept} messages were kept for the one that does not read"
        print(f"motion: commanded within {1000 * max(errors):.1f} mrad of measured; pause, stop; one deaf client lost, {kept} kept")


def arm_sockets(url):
    """Returns the established connections to the agent, from the list of the operating system."""
    port = int(url.rsplit(":", 1)[1])
    rows = pathlib.Path("/proc/net/tcp").read_text().splitlines()[1:]
    return sum(row.split()[1].endswith(f":{port:04X}") and row.split()[3] == "01" for row in rows)


async def refused(arm, **options):
    """Returns the HTTP status with which a socket is refused."""
    try:
        async with socket(arm.url, **options):
            return 101
    except websockets.InvalidStatus as error:
        return error.response.status_code


async def check_origins(arm, tokens, log):
    """Checks that pages of an allowed origin have read-only access, and other pages no access."""
    page = Agent(arm.url, tokens["operator"])
    for path in ("/api/status", "/metrics"):
        status, text, headers = page.ask("GET", path, Origin=ORIGIN)
        assert status == 200 and headers["Access-Control-Allow-Origin"] == ORIGIN, path
        assert path != "/api/status" or json.loads(text)["role"] == "viewer"
        assert page.ask("GET", path, Origin="https://evil.example")[0] == 403
    for method, path in [
        ("POST", "/api/stop"),
        ("POST", "/api/lease"),
        ("GET", "/api/events"),
        ("GET", "/api/jobs"),
        ("GET", "/openapi.json"),
    ]:
        status, _, headers = page.ask(method, path, {} if method == "POST" else None, Origin=ORIGIN)
        assert status == 403 and "Access-Control-Allow-Origin" not in headers, (method, path, status)
    preflight = {"Origin": ORIGIN, "Access-Control-Request-Method": "GET"}
    assert Agent(arm.url, None).ask("OPTIONS", "/api/status", **preflight)[0] == 204
    assert Agent(arm.url, None).ask("OPTIONS", "/api/stop", **preflight)[0] == 403
    assert await refused(arm, path="/api/line", origin=ORIGIN, token=tokens["operator"]) == 403
    assert await refused(arm, origin="https://evil.example", token=tokens["viewer"]) == 403
    assert await refused(arm, path=f"/?token={tokens['operator']}") == 403
    assert await refused(arm, path="/api/foxglove?token=0123456789abcdefghij") == 401
    assert await refused(arm, path="/api/foxglove", subprotocols=["other"]) == 400
    assert await refused(arm, subprotocols=["other"]) == 404
    async with socket(arm.url, origin=ORIGIN, path=f"/?token={tokens['viewer']}") as ws:
        viewer = await Viewer.greeted(ws, services=False)
        await viewer.subscribe("/joint_states")
        await viewer.until("/joint_states")
        assert viewer.info["capabilities"] == [] and not viewer.services
        assert await viewer.call(1, 1) == "pages of this origin have read-only access"
    text = log.read_text()
    assert "refused" in text and not any(token in text for token in tokens.values())
    print("origins: an allowed one looks, and does nothing else; no token in the log")


def watched(jtc, directory):
    """Checks an agent at rest and in motion, and the counters among the metrics."""
    log = directory / "commands.jsonl"
    with served.serving(jtc, directory, "--allow-origin", ORIGIN, "--command-log", log) as agent:
        arm = Agent(agent.url, agent.tokens["operator"])
        arm.key = arm.json("POST", "/api/lease", {"name": "reference", "lasts_s": 60})["key"]
        arm.json("PUT", "/api/trajectories/3", {"name": "sway", "text": served.sway(0.3, 6)})
        assert arm.over(arm.json("POST", "/api/recover", {"defaults": True})["number"]) == "finished"
        before = check_metrics(arm)
        with arm.renewing():
            asyncio.run(check_channels(arm))
            asyncio.run(check_motion(arm))
        after = check_metrics(arm)

        def more(name, *labels):
            return after[name, *labels] - before[name, *labels]

        assert more("jtc_halts_total") == 2
        assert more("jtc_jobs_total", ("outcome", "stopped")) == 1 and after["jtc_jobs_running",] == 0
        assert before["jtc_jobs_total", ("outcome", "finished")] == 1
        assert 5 <= more("jtc_frames_sent_total") and more("jtc_frames_denied_total") == 0
        answered = more("jtc_frames_answered_total", ("answer", "accepted"))
        assert 5 <= answered <= more("jtc_frames_sent_total"), answered
        assert more("jtc_statuses_total") > 100 and more("jtc_put_outs_total") == 0
        print(f"metrics: {len(after)} samples, as /api/status, /api/info and this script have them")
        asyncio.run(check_origins(arm, agent.tokens, log))


if __name__ == "__main__":
    served.run(watched)
