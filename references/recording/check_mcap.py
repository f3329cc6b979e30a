"""Reads a recording with the MCAP and ROS 2 libraries of other projects, as Foxglove does, and checks its contents.

usage: check_mcap.py RECORDING.mcap [RECORDING.csv]

Needs `mcap` and `mcap-ros2-support` from PyPI. If a CSV file of the same run is given, both must contain the same numbers.
"""

import csv
import math
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/joint_commands": "sensor_msgs/msg/JointState",
    "/jtc/control": "openjtc_msgs/msg/JointControl",
    "/jtc/state": "openjtc_msgs/msg/ControllerState",
}
# Topics that check_standalone.py and check_readers.py check.
OTHERS = {"/robot_description", "/tf", "/jtc/trajectory", "/jtc/trajectory_then", "/jtc/log"}


def same(a, b):
    return (math.isnan(a) and math.isnan(b)) or abs(a - b) < 1e-8


def main():
    path = sys.argv[1]
    messages = {topic: [] for topic in TOPICS}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        for channel in summary.channels.values():
            if channel.topic in OTHERS:
                continue
            schema = summary.schemas[channel.schema_id]
            assert TOPICS[channel.topic] == schema.name and schema.encoding == "ros2msg", (channel, schema)
        for schema, channel, message, decoded in reader.iter_decoded_messages(topics=list(TOPICS)):
            stamp = decoded.header.stamp
            assert stamp.sec * 1_000_000_000 + stamp.nanosec == message.log_time, "stamp and log time differ"
            messages[channel.topic].append((message.log_time, decoded))
        metadata = [m for m in reader.iter_metadata() if m.name == "openjtc"]
    assert len(metadata) == 1, "no metadata record"
    counts = {topic: len(found) for topic, found in messages.items()}
    assert len(set(counts.values())) == 1 and counts["/joint_states"] > 0, counts
    names = [metadata[0].metadata[f"joint{j}_name"] for j in range(1, 7)]
    for topic in ("/joint_states", "/joint_commands"):
        for _, m in messages[topic]:
            assert list(m.name) == names and len(m.position) == len(m.velocity) == len(m.effort) == 6
    times = [t for t, _ in messages["/joint_states"]]
    assert times == sorted(times), "times go back"
    for (_, states), (_, commands), (_, control) in zip(
        messages["/joint_states"], messages["/joint_commands"], messages["/jtc/control"]
    ):
        for j in range(6):
            # The error belongs to the time of the measurement, some ticks before.
            way = 0.01 * (abs(commands.velocity[j]) + 0.1)
            assert not abs(control.position_error[j] - (commands.position[j] - states.position[j])) > way
            assert same(control.torque[j], states.effort[j])
    if len(sys.argv) > 2:
        with open(sys.argv[2], newline="") as stream:
            rows = list(csv.DictReader(stream))
        assert len(rows) == counts["/joint_states"], "another number of samples"
        number = lambda text: float(text) if text else math.nan
        for row, (_, states), (_, control), (_, state) in zip(
            rows, messages["/joint_states"], messages["/jtc/control"], messages["/jtc/state"]
        ):
            assert (int(row["state"]), int(row["tes"])) == (state.state, state.trajectory_state)
            assert int(row["point"]) == state.point
            for j in range(6):
                assert same(number(row[f"q{j + 1}_position_rad"]), states.position[j])
                assert same(number(row[f"q{j + 1}_torque_model_nm"]), control.torque_model[j])
                assert same(number(row[f"q{j + 1}_temperature_c"]), control.temperature[j])
    seconds = (times[-1] - times[0]) / 1e9
    print(f"{path}: {counts['/joint_states']} samples of {', '.join(names)} over {seconds:.3f} s, all as written")


if __name__ == "__main__":
    main()
