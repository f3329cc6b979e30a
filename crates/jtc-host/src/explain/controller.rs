//! Pages about the controller: errors, CAN flags, states.

use super::entries;

entries! {
    Jtc {
        0 "emergency-input":
            "The safety input is low: all torques are zero.",
            "Emergency stop pressed, safety relay open, or the wire of the input broken (it is pulled down).",
            "Make the cell safe, release the emergency stop, then clear the errors.",
            "jtc recover";
        1 "emergency-output":
            "The controller holds its safety output at 0.",
            "An internal error is latched (see the other bits).",
            "Find and remove the internal error; the output goes back to 1 when errors are cleared.",
            "jtc status";
        2 "internal-error":
            "The controller found an error by itself.",
            "One of: joint over a limit, CAN timeout. With neither of these bits beside it: the device itself failed \
             (watchdog, hard fault, panic) and was reset; its log holds the place.",
            "Look at the more specific bits beside it; after a reset clear the errors and send the parameters again.",
            "jtc status";
        3 "external-error":
            "Something outside the controller reports an error.",
            "The safety input is low, or a node reports a fault.",
            "Look at the more specific bits beside it.",
            "jtc status";
        4 "internal-joint-error":
            "A joint left what is allowed: position, velocity, acceleration, torque, tracking or friction table.",
            "See the internal error word of each joint.",
            "Explain the joint word; correct trajectory, gains or model.",
            "jtc explain joint:WORD";
        5 "internal-can-error":
            "The joint bus does not work: a node is silent, or nobody acknowledges.",
            "Cable, terminator, supply of a drive, wrong node number.",
            "See the CAN flags for which node.",
            "jtc doctor";
        6 "internal-com-error":
            "Error of the host link.",
            "Other firmware only: this controller takes a silent host for no error.",
            "Check the firmware of the controller.",
            "jtc status";
        7 "external-joint-error":
            "A node reports a fault, left its enabled state unasked, or its safety line is active.",
            "See error, warning and motor-control bytes of each node.",
            "Remove the cause at the drive, then clear.",
            "jtc recover";
    }
    Joint {
        0 "joint-position":
            "The commanded position is over its limit, or would be in a trajectory whose Execute was refused.",
            "The trajectory goes beyond the limits of this arm.",
            "Check the trajectory against the arm file.",
            "jtc traj check FILE";
        1 "joint-velocity":
            "The commanded velocity is over its limit.",
            "The trajectory is too fast, also between its points.",
            "Run it slower.",
            "jtc traj run FILE --speed 50";
        2 "joint-acceleration":
            "The commanded acceleration is over its limit.",
            "The trajectory changes speed too quickly.",
            "Run it slower, or smooth it.",
            "jtc traj check FILE";
        3 "joint-torque":
            "The computed torque is over its limit, or something pushes the joint. In HoldPos it is a held stop: the arm is held.",
            "Too fast, too heavy a load, an obstacle, or an arm model that is not this arm.",
            "Look for an obstacle; check the load and the arm model. A held stop ends with `jtc clear`.",
            "jtc traj check FILE --arm ARM";
        4 "joint-position-error":
            "Commanded and measured position are too far apart. In HoldPos it is a held stop: the arm is held.",
            "Obstacle, gains too low, wrong friction or model, a drive that gives no torque.",
            "Look for an obstacle; compare model and friction with the arm. A held stop ends with `jtc clear`.",
            "jtc status";
        5 "joint-friction-table":
            "The friction table has no value for this speed and temperature.",
            "The bearing is colder or warmer, or the joint faster, than the table reaches.",
            "Use the polynomial, or a table with wider axes.",
            "jtc params use-defaults";
    }
    Can {
        0 "can-transmit-timeout":
            "Frames of the controller are not acknowledged, or the bus is off.",
            "No node powered, cable open or shorted, terminator missing.",
            "Check power, cable and both 120 ohm terminators.",
            "jtc doctor";
        8 "can-no-answer-joint-1":
            "Joint 1 (node 0) does not answer.",
            "Its supply or cable is off, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 1";
        9 "can-no-answer-joint-2":
            "Joint 2 (node 1) does not answer.",
            "Its supply or cable is off, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 2";
        10 "can-no-answer-joint-3":
            "Joint 3 (node 2) does not answer.",
            "Its supply or cable is off, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 3";
        11 "can-no-answer-joint-4":
            "Joint 4 (node 3) does not answer.",
            "Its supply or cable is off, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 4";
        12 "can-no-answer-joint-5":
            "Joint 5 (node 4) does not answer.",
            "Its supply or cable is off, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 5";
        13 "can-no-answer-joint-6":
            "Joint 6 (node 5) does not answer.",
            "Its supply or cable is off, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 6";
        14 "can-no-answer-gripper":
            "The gripper does not answer.",
            "Its supply or cable is off, its node number is wrong, or it restarts.",
            "If there is no gripper, the controller must be configured without.",
            "jtc reset --gripper";
    }
    State {
        0 "state-start":
            "Set-up is not complete.",
            "Just switched on.",
            "Wait.",
            "jtc status";
        1 "state-init":
            "Nodes are brought up and parameters are awaited; torques are zero.",
            "After switching on, after a reset, or when a node restarted.",
            "Give the parameters; the drives need some 5 s.",
            "jtc recover";
        2 "state-hold-pos":
            "The arm holds its position.",
            "Normal.",
            "Ready for a trajectory.",
            "jtc traj run FILE";
        3 "state-operate":
            "The trajectory is followed.",
            "Normal.",
            "Follow it, or stop it.",
            "jtc traj stop";
        4 "state-teaching":
            "Gravity compensation only: the arm can be moved by hand.",
            "Teaching was switched on.",
            "Switch it off to hold the position.",
            "jtc teach off";
        5 "state-error":
            "An error is latched: torques are zero until the cause is gone and errors are cleared.",
            "See the error words.",
            "Remove the cause.",
            "jtc recover";
    }
    Tes {
        0 "tes-null":
            "There is no complete trajectory.",
            "Nothing uploaded, or forgotten in Init or Error.",
            "Upload one.",
            "jtc traj run FILE";
        1 "tes-stop":
            "A trajectory is complete and at its start.",
            "Uploaded or stopped.",
            "Run it: what was uploaded before is checked and uploaded again.",
            "jtc traj run FILE";
        2 "tes-pause":
            "The motion is paused on the path.",
            "Pause was asked for.",
            "Go on or stop.",
            "jtc traj resume";
        3 "tes-execute":
            "The trajectory is being executed.",
            "Normal.",
            "Follow it.",
            "jtc monitor";
        4 "tes-finish":
            "The trajectory was executed to its last point.",
            "Normal.",
            "Run it again from its start, or upload another.",
            "jtc traj run FILE --approach";
        5 "tes-trans-null-to-stop":
            "A trajectory is being completed; other firmware only.",
            "Normal.",
            "Wait.",
            "jtc status";
    }
}
