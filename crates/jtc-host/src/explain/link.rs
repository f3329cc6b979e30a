//! Pages about the records of received frames.

use super::entries;

entries! {
    Data {
        0 "data-idle":
            "No data to judge.",
            "The status carries no record, or its frame arrived damaged.",
            "Nothing.",
            "jtc status";
        1 "data-no-error":
            "The data were taken.",
            "A good frame.",
            "Nothing.",
            "jtc status";
        2 "too-many-points":
            "More points than the controller holds (12,000 in all, 1,500 in a segment).",
            "Trajectory too long for its step.",
            "Use a longer step: the controller interpolates each millisecond.",
            "jtc traj check FILE";
        3 "too-many-segments":
            "More than 100 segments.",
            "Segments too short for this trajectory.",
            "Leave --points-per-segment away.",
            "jtc traj run FILE";
        4 "incorrect-segment-order":
            "A segment is repeated, skipped or from another trajectory.",
            "A segment before it was lost, or two programs send at once.",
            "The upload sends again by itself; make sure that only one program sends.",
            "jtc doctor";
        5 "incorrect-step-time":
            "The step time is 0 or differs from the first segment.",
            "File or program that sends it.",
            "Check the file.",
            "jtc traj check FILE";
        6 "incorrect-value":
            "A number that cannot be, or would throw or drop the arm: NaN, negative mass or gain, bounds exchanged, axis not \
             increasing, unknown command, gains, masses or friction beyond the bounds of these drives, a model whose weight the \
             torque limits cannot hold; or a trajectory that leaves a limit: when it is uploaded or, if it came from an existing host, \
             when it is executed.",
            "File or program that sends it.",
            "The push names the number, `jtc traj check` the place of a trajectory.",
            "jtc params push FILE";
        7 "not-allowed":
            "This is not possible in the present state.",
            "For example a trajectory outside HoldPos, or teaching while moving.",
            "Look at the state; stop the motion or recover first.",
            "jtc status";
        8 "start-position-mismatch":
            "A joint is farther from the first point than allowed (0.02 rad).",
            "The arm was moved, or the trajectory begins elsewhere.",
            "Let it be moved there first.",
            "jtc traj run FILE --approach";
    }
    Frame {
        0 "frame-idle":
            "No frame was received.",
            "The status carries no record.",
            "Nothing.",
            "jtc status";
        1 "frame-no-error":
            "The frame arrived whole.",
            "A good frame.",
            "Nothing.",
            "jtc status";
        2 "incorrect-header":
            "Bytes that begin no frame, or an impossible length.",
            "Noise, wrong rate, or a program that speaks something else.",
            "Check rate, cable and earth.",
            "jtc doctor";
        3 "incorrect-frame-type":
            "A frame type, or a length for its type, that there is not.",
            "Noise, or a program for another firmware.",
            "Check what sends it.",
            "jtc decode";
        4 "incorrect-crc":
            "The check sum is wrong.",
            "Bits lost on the line.",
            "Check cable and earth; a lower rate helps.",
            "jtc doctor";
        5 "discontinuous-frame":
            "A gap of 5 ms or more within a frame.",
            "The sending computer paused, or bytes were lost.",
            "Nothing if it is rare: frames are sent again.",
            "jtc doctor";
    }
}
