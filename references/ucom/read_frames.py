"""Prints the number of frames that python-can and cantools read in a second. Usage: `read_frames.py DBC CANDUMP-LOG`"""

import sys
import time

import can
import cantools


def main(dbc: str, log: str) -> None:
    database = cantools.database.load_file(dbc)
    known = {message.frame_id for message in database.messages}
    frames = [frame for frame in can.LogReader(log) if frame.arbitration_id in known]
    assert len(frames) > 100, f"{len(frames)} frames that {dbc} knows"
    best = float("inf")
    for _ in range(5):
        start = time.thread_time()
        for frame in frames:
            database.decode_message(frame.arbitration_id, frame.data, allow_truncated=True)
        best = min(best, (time.thread_time() - start) / len(frames))
    print(1.0 / best)


main(*sys.argv[1:])
