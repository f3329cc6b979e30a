//! Pages about drives and gripper: errors, warnings, faults, states.

use super::entries;

entries! {
    Node {
        0 "node-encoder":
            "The position encoder failed.",
            "Encoder cable or magnet; older drives only.",
            "Check the encoder of the drive.",
            "jtc status";
        1 "node-motor-control":
            "The motor control reports a fault.",
            "See the motor-control fault byte.",
            "Explain that byte, remove the cause, clear.",
            "jtc explain motor:BYTE";
        2 "node-over-speed":
            "The joint turned faster than the drive allows.",
            "Pushed by hand or by gravity, a wrong model in teaching, or a trajectory too fast.",
            "Clear, and run slower.",
            "jtc recover";
        3 "node-hardware":
            "The gate driver reports a fault.",
            "Over-current, supply of the driver, damage.",
            "Switch the drive off and on; if it stays, the drive needs service.",
            "jtc recover";
    }
    Warning {
        0 "position-not-accurate":
            "The drive does not yet know its position.",
            "Encoder search not done.",
            "The controller waits in Init until it is gone; move the joint if it does not go.",
            "jtc status";
        1 "outside-working-area":
            "The joint is outside its working area: only torque towards the inside is driven.",
            "Moved there by hand or by gravity.",
            "Move it back, for example in teaching.",
            "jtc teach on";
        2 "magnetic-field":
            "The field of the encoder magnet is out of range.",
            "Magnet loose or too far away; older drives only.",
            "The drive needs service.",
            "jtc status";
        3 "safety-line":
            "The safety line of the drive is active.",
            "Emergency stop of the drive line, or its wire broken.",
            "Release it, then clear: the controller does not go on by itself.",
            "jtc recover";
    }
    Motor {
        0 "motor-foc-duration":
            "The current loop took too long.",
            "Firmware of the drive.",
            "Clear; report it if it comes again.",
            "jtc recover";
        1 "motor-over-voltage":
            "Supply above its limit.",
            "Braking energy with nowhere to go, wrong supply.",
            "Check supply and brake resistor; brake less hard.",
            "jtc recover";
        2 "motor-under-voltage":
            "Supply below its limit.",
            "Supply off, too weak, or a loose cable.",
            "Check the supply under load.",
            "jtc recover";
        3 "motor-over-temperature":
            "The power stage is too hot.",
            "Long high torque, or poor cooling.",
            "Let it cool by 10 K, then clear.",
            "jtc monitor";
        4 "motor-start-up":
            "The motor did not start.",
            "Blocked rotor, brake closed, motor cable.",
            "Check that the joint can move; clear.",
            "jtc recover";
        5 "motor-speed-feedback":
            "The speed feedback is not plausible.",
            "Encoder or motor cable.",
            "Check the cables; clear.",
            "jtc recover";
        6 "motor-over-current":
            "The over-current protection tripped.",
            "Short circuit, blocked joint, wrong current gains.",
            "Check motor cable and mechanics; clear.",
            "jtc recover";
        7 "motor-software":
            "Software error of the motor control.",
            "Firmware of the drive.",
            "Reset the drive.",
            "jtc reset --joints N";
    }
    NodeState {
        0 "node-start":
            "The node starts.",
            "Just switched on or reset.",
            "Wait.",
            "jtc status";
        1 "node-init":
            "The node is on, motor off, and waits for its configuration.",
            "Normal after a start.",
            "The controller configures it.",
            "jtc status";
        2 "node-ready":
            "Configured, motor off.",
            "Normal in Init and Error.",
            "The controller enables it.",
            "jtc status";
        3 "node-enabled":
            "The node follows its commands.",
            "Normal.",
            "Nothing.",
            "jtc status";
        10 "node-in-transition":
            "The node goes from one state to the next (numbers 10 to 16).",
            "The controller asked for another state; the first enabling of a drive takes some 4 s.",
            "Wait; a node that stays there is faulty.",
            "jtc doctor";
        9 "unknown-state":
            "A state that this program does not know.",
            "A newer firmware, or a frame that was damaged and passed its check.",
            "Compare the versions of controller and program.",
            "jtc decode";
        254 "node-fault-reaction":
            "The node is going to its fault state.",
            "A fault was just found.",
            "See its error bytes.",
            "jtc status";
        255 "node-fault":
            "The node is in its fault state, motor off.",
            "See its error and motor-control bytes; they may be 0.",
            "Remove the cause, then clear: that leads the node through Init.",
            "jtc recover";
    }
}
