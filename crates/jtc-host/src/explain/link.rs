//! Pages about the data status and the frame status of a response.

use super::entries;

entries! {
    Data {
        0 "data-idle":
            "The status has no result for data.",
            "The status has no record of a frame, or the recorded frame arrived damaged.",
            "No action is needed.",
            "jtc status";
        1 "data-no-error":
            "The controller accepted the data.",
            "The frame is valid.",
            "No action is needed.",
            "jtc status";
        2 "too-many-points":
            "The trajectory has more points than the controller can hold (12,000 in total, 1,500 in a \
             segment).",
            "The trajectory is too long for its step time.",
            "Use a longer step: the controller interpolates between the points each millisecond.",
            "jtc traj check FILE";
        3 "too-many-segments":
            "The trajectory has more than 100 segments.",
            "The segments are too short for this trajectory.",
            "Leave out --points-per-segment.",
            "jtc traj run FILE";
        4 "incorrect-segment-order":
            "A segment is repeated, skipped or from another trajectory.",
            "An earlier segment was lost, or two programs send at the same time.",
            "Make sure that only one program sends. The upload sends a lost segment again by itself.",
            "jtc doctor";
        5 "incorrect-step-time":
            "The step time is 0 or differs from the first segment.",
            "The file or the program that sends the trajectory has an error.",
            "Check the file.",
            "jtc traj check FILE";
        6 "incorrect-value":
            "A value is invalid or unsafe for the arm. Invalid values are, for example, NaN, a negative \
             mass or gain, exchanged bounds, an axis that does not increase, and an unknown command. Unsafe \
             values are gains, masses or friction beyond the bounds of these drives, a model whose weight \
             the torque limits cannot hold, and a trajectory that exceeds a limit. The controller checks a \
             trajectory during the upload or, for a host without extensions, before the motion.",
            "The file or the program that sends the value has an error.",
            "Correct the value. `jtc params push` names it; for a trajectory, `jtc traj check` names the \
             point.",
            "jtc params push FILE";
        7 "not-allowed":
            "The controller does not allow this request in its present state.",
            "For example, a host sent a trajectory outside HoldPos, or requested teaching during a motion.",
            "Look at the state. Stop the motion, or recover, first.",
            "jtc status";
        8 "start-position-mismatch":
            "A joint is farther from the first point than the tolerance of 0.02 rad.",
            "The arm was moved, or the trajectory begins elsewhere.",
            "Move the arm to the first point.",
            "jtc traj run FILE --approach";
    }
    Frame {
        0 "frame-idle":
            "No frame was received.",
            "The status has no record of a frame.",
            "No action is needed.",
            "jtc status";
        1 "frame-no-error":
            "The frame arrived complete and undamaged.",
            "The frame is valid.",
            "No action is needed.",
            "jtc status";
        2 "incorrect-header":
            "The bytes do not begin a valid frame, or its length is impossible.",
            "Noise, a wrong baud rate, or a program that uses another protocol.",
            "Check the baud rate, the cable and the earth connection.",
            "jtc doctor";
        3 "incorrect-frame-type":
            "The frame type is unknown, or the length is invalid for this type.",
            "Noise, or a program for another firmware.",
            "Check the program that sends the frame.",
            "jtc decode";
        4 "incorrect-crc":
            "The checksum of the frame is wrong.",
            "Bits were lost on the line.",
            "Check the cable and the earth connection. A lower baud rate helps.",
            "jtc doctor";
        5 "discontinuous-frame":
            "The frame has a gap of 5 ms or more.",
            "The sending computer paused, or bytes were lost.",
            "No action is needed if this error is rare: the host sends the frame again.",
            "jtc doctor";
    }
}
