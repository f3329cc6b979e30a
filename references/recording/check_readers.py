"""Reads whole recordings with the plain loops of two packages of other projects, without a choice of topics.

usage: check_readers.py JTC RECORDING.mcap

Needs `mcap`, `mcap-ros2-support` and `rosbags` from PyPI. Each channel must have a schema: ROS 2's own programs refuse the whole file
if one channel has none. JTC is the command `jtc`. The check runs a simulated arm, and records a run, a repeated run and the flight recorder.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore


def topics_of(path):
    """Returns the number of messages of each topic, which all readers must find."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            assert schema.encoding == "ros2msg" and channel.message_encoding == "cdr", channel
        decoded = [channel.topic for _, channel, _, _ in reader.iter_decoded_messages()]
    plain = [message.channel.topic for message in read_ros2_messages(str(path))]
    assert plain == decoded, path
    with AnyReader([Path(path)], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        bags = []
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            bags.append(connection.topic)
    assert sorted(bags) == sorted(decoded), path
    return {topic: decoded.count(topic) for topic in decoded}


def simulated(jtc, folder, *options):
    """Starts a simulated arm on the line `arm`, and waits for the line."""
    port = folder / "arm"
    port.unlink(missing_ok=True)
    command = [jtc, "sim", "--serial", str(port), "--no-throttle", *options]
    simulator = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60
    while not port.exists():
        assert time.monotonic() < end and simulator.poll() is None, "no simulator"
        time.sleep(0.05)
    return simulator


def recorded(jtc, folder):
    """Records runs, the flight recorder and each millisecond of a simulation."""

    def run(*arguments):
        subprocess.run([jtc, *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    line = ["--port", str(folder / "arm")]
    run("example", "motion")
    simulator = simulated(jtc, folder, "--speed", "max")
    try:
        run("recover", "--defaults", *line)
        run("traj", "run", "motion.csv", "--approach", "--record", "run.mcap", *line)
        run("traj", "run", "motion.csv", "--approach", "--repeat", "2", "--record", "repeated.mcap", *line)
        run("move", "--to", "0.1,0.1,0.1,0.1,0.1,0.1", "--record", "move.mcap", *line)
        run("log", "fetch", "-o", "log.mcap", *line)
    finally:
        simulator.terminate()
        simulator.wait(60)
    # Without `--speed max` the simulation of a second has a thousand samples, and not many more.
    simulator = simulated(jtc, folder, "--record", "sim.mcap")
    time.sleep(1.0)
    simulator.terminate()
    simulator.wait(60)
    return ["run.mcap", "repeated.mcap", "move.mcap", "log.mcap", "sim.mcap"]


def main():
    jtc, demo = sys.argv[1:3]
    found = {"demo": topics_of(demo)}
    with tempfile.TemporaryDirectory() as folder:
        for name in recorded(str(Path(jtc).resolve()), Path(folder)):
            found[name] = topics_of(Path(folder) / name)
    assert found["run.mcap"]["/jtc/trajectory"] == 1 and found["log.mcap"]["/jtc/log"] == 1, found
    for name, topics in found.items():
        print(f"{name}: {sum(topics.values())} messages of {len(topics)} topics, read by all readers")


if __name__ == "__main__":
    main()
