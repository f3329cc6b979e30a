//! Pages about the controller: errors, CAN flags and states.

use super::entries;

entries! {
    Jtc {
        0 "emergency-input":
            "The safety input is low: all torques are zero.",
            "The emergency stop is pressed, the safety relay is open, or the wire of the input is broken (an \
             open input reads low).",
            "Make the cell safe, release the emergency stop, then clear the errors.",
            "jtc recover";
        1 "emergency-output":
            "The controller holds its safety output at 0.",
            "An internal error is latched (see the other bits).",
            "Remove the cause of the internal error. The output returns to 1 when the errors are cleared.",
            "jtc status";
        2 "internal-error":
            "The controller has detected an internal error.",
            "A joint is over a limit (bit 4), or the joint bus does not work (bit 5). If neither bit is set, \
             ten ticks were late or missing within one second, or the board was reset after a watchdog \
             timeout, a hard fault or a panic. The log of the board shows the place of such a failure.",
            "Look at the more specific bits. After a reset clear the errors, and send the parameters again.",
            "jtc status";
        3 "external-error":
            "A device outside the controller reports an error.",
            "The safety input is low, or a node reports a fault.",
            "Look at the more specific bits.",
            "jtc status";
        4 "internal-joint-error":
            "A joint is over a limit of position, velocity, acceleration, torque or position error, or \
             outside its friction table.",
            "The internal error word of each joint shows the cause.",
            "Look up the joint word, then correct the trajectory, the gains or the model.",
            "jtc explain joint:WORD";
        5 "internal-can-error":
            "The joint bus does not work: a node does not answer, or no node acknowledges frames.",
            "A faulty cable or terminator, a drive without supply, or a wrong node number.",
            "Look at the CAN flags: they show the node.",
            "jtc doctor";
        6 "internal-com-error":
            "The host link has an error.",
            "Only other firmware reports this error: this controller does not treat a silent host as an \
             error.",
            "Check the firmware of the controller.",
            "jtc status";
        7 "external-joint-error":
            "A node reports a fault, left its enabled state without a command, or its safety line is active.",
            "The error, warning and motor-control bytes of each node show the cause.",
            "Remove the cause at the drive, then clear the errors.",
            "jtc recover";
    }
    Joint {
        0 "joint-position":
            "The commanded position is over its limit, or the controller refused to execute a trajectory \
             that exceeds the limit.",
            "The trajectory goes beyond the limits of this arm.",
            "Check the trajectory against the arm file.",
            "jtc traj check FILE";
        1 "joint-velocity":
            "The commanded velocity is over its limit, or the measured speed was over 1.2 times this limit \
             for 5 ms (settings `overspeed_factor` and `overspeed_ms`).",
            "The trajectory is too fast at its points or between them. A measured speed that is too high can \
             also come from a person, gravity or a wrong arm model that moves the joint.",
            "Run the trajectory slower. If no trajectory ran, first find what moved the joint.",
            "jtc traj run FILE --speed 50";
        2 "joint-acceleration":
            "The commanded acceleration is over its limit.",
            "The trajectory changes speed too quickly.",
            "Run the trajectory slower, or smooth it.",
            "jtc traj check FILE";
        3 "joint-torque":
            "The computed torque is over its limit, or something pushes the joint. In HoldPos this is a held \
             stop: the controller holds the arm.",
            "The motion is too fast, the load is too heavy, an obstacle is in the path, or the arm model \
             does not match the arm.",
            "Look for an obstacle, and check the load and the arm model. `jtc clear` ends a held stop.",
            "jtc traj check FILE --arm ARM";
        4 "joint-position-error":
            "Commanded and measured position are too far apart, or the two encoders of the joint do not \
             match. In HoldPos this is a held stop: the controller holds the arm.",
            "An obstacle, gains that are too low, wrong friction or a wrong arm model, a drive without \
             torque, or a faulty encoder.",
            "Look for an obstacle, and compare model and friction with the arm. `jtc clear` ends a held \
             stop.",
            "jtc status";
        5 "joint-friction-table":
            "The friction table has no value for this speed and temperature.",
            "The temperature of the bearing or the speed of the joint is outside the table.",
            "Use the friction polynomial, or a table with a wider range.",
            "jtc params use-defaults";
    }
    Can {
        0 "can-transmit-timeout":
            "Frames of the controller are not acknowledged, or the bus is off.",
            "No node has power, the cable is open or shorted, or a terminator is missing.",
            "Check power, cable and both 120 ohm terminators.",
            "jtc doctor";
        8 "can-no-answer-joint-1":
            "Joint 1 (node 0) does not answer.",
            "The node has no supply or no connection, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 1";
        9 "can-no-answer-joint-2":
            "Joint 2 (node 1) does not answer.",
            "The node has no supply or no connection, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 2";
        10 "can-no-answer-joint-3":
            "Joint 3 (node 2) does not answer.",
            "The node has no supply or no connection, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 3";
        11 "can-no-answer-joint-4":
            "Joint 4 (node 3) does not answer.",
            "The node has no supply or no connection, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 4";
        12 "can-no-answer-joint-5":
            "Joint 5 (node 4) does not answer.",
            "The node has no supply or no connection, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 5";
        13 "can-no-answer-joint-6":
            "Joint 6 (node 5) does not answer.",
            "The node has no supply or no connection, its node number is wrong, or it restarts.",
            "Check supply and cable of this drive and of the one before it.",
            "jtc reset --joints 6";
        14 "can-no-answer-gripper":
            "The gripper does not answer.",
            "The node has no supply or no connection, its node number is wrong, or it restarts.",
            "If the arm has no gripper, configure the controller without a gripper.",
            "jtc reset --gripper";
    }
    State {
        0 "state-start":
            "The controller has not completed its set-up.",
            "The controller was just switched on.",
            "Wait.",
            "jtc status";
        1 "state-init":
            "The controller configures the nodes and waits for parameters. All torques are zero.",
            "The controller was switched on or reset, or a node restarted.",
            "Send the parameters, and wait about 5 s for the drives.",
            "jtc recover";
        2 "state-hold-pos":
            "The arm holds its position.",
            "Normal.",
            "Run a trajectory: the controller is ready.",
            "jtc traj run FILE";
        3 "state-operate":
            "The arm follows the trajectory.",
            "Normal.",
            "Watch the motion, or stop it.",
            "jtc traj stop";
        4 "state-teaching":
            "The controller compensates gravity and the detected load, and damps the joints, so that you can \
             move the arm by hand.",
            "Teaching was switched on.",
            "Switch teaching off to hold the position.",
            "jtc teach off";
        5 "state-error":
            "An error is latched: torques are zero until the cause is removed and the errors are cleared.",
            "The error words show the cause.",
            "Remove the cause.",
            "jtc recover";
    }
    Tes {
        0 "tes-null":
            "The controller has no complete trajectory.",
            "No trajectory was uploaded completely, or the controller discarded it in Init, Error or \
             Teaching.",
            "Upload a trajectory.",
            "jtc traj run FILE";
        1 "tes-stop":
            "A complete trajectory is loaded and at its start.",
            "The trajectory was uploaded or stopped.",
            "Run the trajectory: the command checks it and uploads it again.",
            "jtc traj run FILE";
        2 "tes-pause":
            "The motion is paused on the path.",
            "A host requested Pause, a held stop interrupted the motion, or no valid frame arrived for the \
             time `host_timeout_ms`.",
            "Resume or stop the motion. After a held stop, first remove its cause and clear the errors.",
            "jtc traj resume";
        3 "tes-execute":
            "The trajectory is being executed.",
            "Normal.",
            "Watch the motion.",
            "jtc monitor";
        4 "tes-finish":
            "The trajectory was executed to its last point.",
            "Normal.",
            "Run it again from its start, or upload another trajectory.",
            "jtc traj run FILE --approach";
        5 "tes-trans-null-to-stop":
            "The controller receives a trajectory. Only older controllers report this state.",
            "Normal.",
            "Wait.",
            "jtc status";
    }
}
