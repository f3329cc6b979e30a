"""Chain of UCoM boards: numbers the boards, examines them, drives them by name, and records a table.

Without an argument the chain is a simulated head; an argument is the URL of a bus, such as socketcan:can0. **Joints
move.**
"""

import math
import sys
import time

from openjtc import Error, ucom


def main(bus: str) -> None:
    with ucom.connect(bus) as chain:
        # Numbers the boards along the init wire and lists them.
        boards = chain.init().boards
        print(f"{len(boards)} boards")
        for board in boards:
            print(f"  {board.number:2}  0x{board.flash_number:04X}  {board.state:9}  {board.description}")

        # Starts the applications of the boards without movement. Only started applications send the names of their
        # signals.
        chain.start([1, 2])
        for signal in chain.boards[1].signals.inputs:
            print(f"  input {signal.text}, {signal.minimum:g} to {signal.maximum:g}")

        # The chain supervises the control loops until the end of the context. In the simulated head, a step of a
        # value is 0.01 degrees.
        report = chain.run([1, 2], active=True, inputs={"1.set_position": 0, "2.set_position": 0})
        print(f"boards {report.boards} run; {report.load_percent:.0f} % of the bus")

        begin = time.monotonic()
        while (passed := time.monotonic() - begin) < 1.0:
            chain["2.set_position"] = round(500 * math.sin(2 * math.pi * passed))
            time.sleep(0.02)

        chain["1.set_position"] = 1500
        table = chain.monitor(1, seconds=1.5).to_numpy()[1]
        position = table.values[:, table.names.index("position")] / 100
        print(f"board 1 moved from {position[0]:.1f} to {position[-1]:.1f} degrees in {len(position)} samples")

        for finding in chain.doctor().findings:
            print(f"{finding.severity}: {finding.what}")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "sim:")
    except Error as error:
        sys.exit(str(error))
