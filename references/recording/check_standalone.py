"""Reads the arm in a recording with the libraries of other projects, and checks it with Pinocchio.

usage: check_standalone.py RECORDING.mcap

Needs `mcap`, `mcap-ros2-support` and `pin` from PyPI. Pinocchio reads the description on /robot_description. Its forward kinematics at
the measured positions must give the link poses of the transforms on /tf. Names and limits must be those of the metadata.
"""

import sys

import numpy as np
import pinocchio
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

TOPICS = ["/robot_description", "/tf", "/joint_states"]
SCHEMAS = {"/robot_description": "std_msgs/msg/String", "/tf": "tf2_msgs/msg/TFMessage"}


def placement(transform):
    t, r = transform.translation, transform.rotation
    quaternion = pinocchio.Quaternion(r.w, r.x, r.y, r.z)
    assert abs(quaternion.norm() - 1.0) < 1e-12, "no unit quaternion"
    return pinocchio.SE3(quaternion.matrix(), np.array([t.x, t.y, t.z]))


def main():
    path = sys.argv[1]
    descriptions, transforms, positions = [], [], {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages(topics=TOPICS):
            if channel.topic in SCHEMAS:
                assert schema.name == SCHEMAS[channel.topic] and schema.encoding == "ros2msg", schema
            if channel.topic == "/robot_description":
                descriptions.append((message.log_time, decoded.data))
            elif channel.topic == "/tf":
                transforms.append((message.log_time, decoded.transforms))
            elif channel.topic == "/joint_states":
                positions[message.log_time] = dict(zip(decoded.name, decoded.position))
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}["openjtc"]

    assert len(descriptions) == 1 and descriptions[0][0] <= min(positions), "the description comes first, once"
    model = pinocchio.buildModelFromXML(descriptions[0][1])
    data = model.createData()
    assert model.nq == 6
    for j, name in enumerate(list(model.names)[1:]):
        assert name == metadata[f"joint{j + 1}_name"], name
        for key, value in [
            ("position_min_rad", model.lowerPositionLimit[j]),
            ("position_max_rad", model.upperPositionLimit[j]),
            ("velocity_max_rad_s", model.velocityLimit[j]),
            ("torque_max_nm", model.effortLimit[j]),
        ]:
            assert abs(float(metadata[f"joint{j + 1}_{key}"]) - value) < 1e-12, (name, key)
        for key in ["kp", "ki", "kd", "int_min_rad_s", "int_max_rad_s"]:
            assert float(metadata[f"joint{j + 1}_{key}"]) is not None
    assert len(metadata["arm_hash"]) == 16 and int(metadata["arm_hash"], 16) != 0

    times = [time for time, _ in transforms]
    assert times == sorted(times) and len(times) > 1
    seconds = (times[-1] - times[0]) / 1e9
    assert len(times) <= 50 * seconds + 2, f"{len(times)} messages in {seconds} s"
    worst = 0.0
    frames = {frame.name: i for i, frame in enumerate(model.frames) if frame.type == pinocchio.FrameType.BODY}
    for time, message in transforms:
        measured = positions[time]
        q = np.array([measured[name] for name in list(model.names)[1:]])
        pinocchio.framesForwardKinematics(model, data, np.nan_to_num(q))
        placed = {"link_0": pinocchio.SE3.Identity()}
        for t in message:
            assert t.header.stamp.sec * 1_000_000_000 + t.header.stamp.nanosec == time
            # The poses after a joint that does not answer are unknown.
            if t.header.frame_id in placed:
                placed[t.child_frame_id] = placed[t.header.frame_id] * placement(t.transform)
        known = next((i for i, position in enumerate(q) if np.isnan(position)), len(frames))
        assert set(placed) == set(sorted(frames, key=frames.get)[: known + 1]), (set(placed), known)
        for name, at in placed.items():
            reference = data.oMf[frames[name]]
            worst = max(worst, np.abs(at.homogeneous - reference.homogeneous).max())
    assert worst < 1e-9, worst
    print(f"{path}: {len(frames)} frames in {len(times)} messages over {seconds:.3f} s, at most {worst:.1e} from Pinocchio's")


if __name__ == "__main__":
    main()
