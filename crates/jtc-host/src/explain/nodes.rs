//! Pages about the drives and the gripper: errors, warnings, faults and states.

use super::entries;

entries! {
    Node {
        0 "node-encoder":
            "The position encoder failed.",
            "The encoder cable or magnet is faulty. Only older drives report this error.",
            "Check the encoder of the drive.",
            "jtc status";
        1 "node-motor-control":
            "The motor control reports a fault.",
            "The motor-control fault byte shows the cause.",
            "Look up that byte, remove the cause, then clear the errors.",
            "jtc explain motor:BYTE";
        2 "node-over-speed":
            "The joint turned faster than the drive allows.",
            "A person or gravity pushed the joint, the model is wrong in teaching, or the trajectory is too \
             fast.",
            "Clear the errors, and run the trajectory slower.",
            "jtc recover";
        3 "node-hardware":
            "The gate driver reports a fault.",
            "Over-current, a wrong supply of the gate driver, or damage.",
            "Switch the drive off and on. If the fault stays, the drive needs service.",
            "jtc recover";
    }
    Warning {
        0 "position-not-accurate":
            "The drive does not yet know its position.",
            "The drive has not completed its encoder search.",
            "Wait: the controller stays in Init until the warning ends. If the warning stays, move the \
             joint.",
            "jtc status";
        1 "outside-working-area":
            "The joint is outside its working area: the drive only applies torque towards the inside.",
            "A person or gravity moved the joint there.",
            "Move the joint back, for example in teaching.",
            "jtc teach on";
        2 "magnetic-field":
            "The field of the encoder magnet is out of range.",
            "The magnet is loose or too far away. Only older drives report this warning.",
            "The drive needs service.",
            "jtc status";
        3 "safety-line":
            "The safety line of the drive is active.",
            "The emergency stop of the drives is pressed, or the wire of the safety line is broken.",
            "Release the emergency stop, then clear the errors: the controller does not continue by itself.",
            "jtc recover";
    }
    Motor {
        0 "motor-foc-duration":
            "The current loop took too long.",
            "A fault in the firmware of the drive.",
            "Clear the errors. If the fault occurs again, report it.",
            "jtc recover";
        1 "motor-over-voltage":
            "The supply voltage is above its limit.",
            "The supply cannot absorb the braking energy, or its voltage is wrong.",
            "Check the supply and the brake resistor, or brake less hard.",
            "jtc recover";
        2 "motor-under-voltage":
            "The supply voltage is below its limit.",
            "The supply is off or too weak, or a cable is loose.",
            "Check the supply under load.",
            "jtc recover";
        3 "motor-over-temperature":
            "The power stage is too hot.",
            "A high torque for a long time, or poor cooling.",
            "Let the power stage cool by 10 K, then clear the errors.",
            "jtc monitor";
        4 "motor-start-up":
            "The motor did not start.",
            "The rotor is blocked, the brake is closed, or the motor cable is faulty.",
            "Check that the joint can move, then clear the errors.",
            "jtc recover";
        5 "motor-speed-feedback":
            "The speed feedback is not plausible.",
            "The encoder or the motor cable is faulty.",
            "Check the cables, then clear the errors.",
            "jtc recover";
        6 "motor-over-current":
            "The over-current protection tripped.",
            "A short circuit, a blocked joint, or wrong current gains.",
            "Check the motor cable and the mechanics, then clear the errors.",
            "jtc recover";
        7 "motor-software":
            "The motor control has a software error.",
            "A fault in the firmware of the drive.",
            "Reset the drive.",
            "jtc reset --joints N";
    }
    NodeState {
        0 "node-start":
            "The node starts.",
            "The node was just switched on or reset.",
            "Wait.",
            "jtc status";
        1 "node-init":
            "The node waits for its configuration. Its motor is off.",
            "Normal after a start.",
            "Wait until the controller has configured the node.",
            "jtc status";
        2 "node-ready":
            "The node is configured. Its motor is off.",
            "Normal in Init and Error.",
            "The controller enables the node.",
            "jtc status";
        3 "node-enabled":
            "The node follows its commands.",
            "Normal.",
            "No action is needed.",
            "jtc status";
        10 "node-in-transition":
            "The node changes from one state to another (numbers 10 to 16).",
            "The controller requested another state. A drive needs about 4 s when it is enabled for the \
             first time.",
            "Wait. A node that stays in this state is faulty.",
            "jtc doctor";
        9 "unknown-state":
            "A state that this program does not know.",
            "The firmware is newer than this program, or a damaged frame passed its check.",
            "Compare the versions of controller and program.",
            "jtc decode";
        254 "node-fault-reaction":
            "The node is changing to its fault state.",
            "The node has just detected a fault.",
            "Look at the error bytes of the node.",
            "jtc status";
        255 "node-fault":
            "The node is in its fault state. Its motor is off.",
            "The error and motor-control bytes of the node show the cause, but may be 0.",
            "Remove the cause, then clear the errors. The controller then leads the node through Init.",
            "jtc recover";
    }
}
