//! Environment variables of `jtc`.

use cli_kit::variables::{Retired, Variables};

/// Environment variables of `jtc`, and environment variables of earlier versions.
pub(crate) const VARIABLES: Variables = Variables {
    json: "JTC_JSON",
    retired: &[
        // Some of these variables caused a motion, a reset, flashing or overwriting. Others confirmed an action,
        // overrode a check, or selected another file.
        Retired::less("JTC_ACCEPT_DEVICE_LIMITS", "", "accept-device-limits"),
        Retired::less("JTC_ACCEPT_SUPPLY", "", "accept-supply"),
        Retired::less("JTC_AGAIN", "", "again"),
        Retired::less("JTC_ALL", "reset", "all"),
        Retired::less("JTC_APPROACH", "", "approach"),
        Retired::less("JTC_ARM", "recover", "arm"),
        Retired::less("JTC_ASSUME_BOARD", "", "assume-board"),
        Retired::less("JTC_DEFAULTS", "recover", "defaults"),
        Retired::less("JTC_FORCE", "", "overwrite"),
        Retired::less("JTC_GRIPPER", "reset", "gripper"),
        Retired::less("JTC_JOINTS", "reset", "joints"),
        Retired::less("JTC_LINK", "serve", "link"),
        Retired::less("JTC_NO_JERK_LIMIT", "plan", "no-jerk-limit"),
        Retired::less("JTC_NO_READ_BACK", "", "no-read-back"),
        Retired::less("JTC_OCCURRED", "clear", "occurred"),
        Retired::less("JTC_OUT", "", "out"),
        Retired::less("JTC_POINTS_PER_SEGMENT", "", "points-per-segment"),
        Retired::less("JTC_REPORT", "", "report"),
        Retired::less("JTC_RECORD", "move", "record"),
        Retired::less("JTC_RECORD", "run", "record"),
        Retired::less("JTC_RECORD", "traj continue", "record"),
        Retired::less("JTC_RECORD", "traj replay", "record"),
        Retired::less("JTC_RECORD", "traj run", "record"),
        Retired::less("JTC_STORE", "arm push", "store"),
        Retired::less("JTC_TO", "", "to"),
        Retired::less("JTC_TO_FLANGE", "", "to-flange"),
        Retired::less("JTC_TRAJECTORY", "traj continue", "trajectory"),
        Retired::less("JTC_YES", "", "yes"),
        // These variables limited or changed a motion or a result. If such a variable were ignored, the result of the
        // command would be different.
        Retired::other("JTC_BLEND", "plan", "blend"),
        Retired::other("JTC_BLEND_M", "plan", "blend-m"),
        Retired::other("JTC_BOARD", "", "board"),
        Retired::other("JTC_COM", "payload set", "com"),
        Retired::other("JTC_COUNT", "monitor", "count"),
        Retired::other("JTC_DEG", "", "deg"),
        Retired::other("JTC_DURATION", "", "duration"),
        Retired::other("JTC_FRICTION", "params push", "friction"),
        Retired::other("JTC_GRAVITY", "dynamics", "gravity"),
        Retired::other("JTC_IMAGE", "", "image"),
        Retired::other("JTC_INERTIA", "payload set", "inertia"),
        Retired::other("JTC_JOINTS", "arm import", "joints"),
        Retired::other("JTC_LINE", "", "line"),
        Retired::other("JTC_MASS", "payload set", "mass"),
        Retired::other("JTC_MEASURED", "traj replay", "measured"),
        Retired::other("JTC_PAYLOAD", "plan", "payload"),
        Retired::other("JTC_PAYLOAD", "traj check", "payload"),
        Retired::other("JTC_REPEAT", "", "repeat"),
        Retired::other("JTC_ROTORS", "dynamics", "rotors"),
        Retired::other("JTC_SPEED_PERCENT", "move", "speed"),
        Retired::other("JTC_SPEED_PERCENT", "plan", "speed"),
        Retired::other("JTC_SPEED_PERCENT", "run", "speed"),
        Retired::other("JTC_SPEED_PERCENT", "traj check", "speed"),
        Retired::other("JTC_SPEED_PERCENT", "traj replay", "speed"),
        Retired::other("JTC_SPEED_PERCENT", "traj resume", "speed"),
        Retired::other("JTC_SPEED_PERCENT", "traj run", "speed"),
        Retired::other("JTC_TEMPERATURE", "plan", "temperature"),
        Retired::other("JTC_TIP", "arm import", "tip"),
        Retired::other("JTC_TOLERANCE", "teach record", "tolerance"),
        Retired::other("JTC_WAYPOINTS", "teach record", "waypoints"),
        Retired::other("JTC_WHEN_GONE", "", "when-gone"),
    ],
    offline: &["help", "explain", "completions", "man"],
};

#[cfg(test)]
mod tests {
    use cli_kit::variables::audit::{Kind, faults};

    use super::*;
    use crate::args::Cli;

    /// A new option must not have a variable that causes an action. Therefore this list contains each permitted
    /// variable, with the reason why it is permitted.
    #[test]
    fn only_places_files_formats_and_harmless_settings_have_a_variable() {
        use Kind::{File, Format, Limit, Line, Output, Place, Simulator};
        let allowed = [
            ("JTC_JSON", Format),
            ("JTC_PORT", Place),
            ("JTC_TOKEN_FILE", File),
            ("JTC_TLS_CA", File),
            ("JTC_BAUD", Line),
            ("JTC_ARM", File),
            ("JTC_TRAJECTORY", File),
            ("JTC_DRIVE", Place),
            ("JTC_WAIT", Limit),
            ("JTC_RUN_RECORD", Output),
            ("JTC_RUN_REPORT", Output),
            ("JTC_PLAN_OUT", Output),
            ("JTC_PLAN_REPORT", Output),
            ("JTC_LOG_OUT", Output),
            ("JTC_LOG_REPORT", Output),
            ("JTC_PULL_OUT", Output),
            ("JTC_IMPORT_OUT", Output),
            ("JTC_REPORT_OUT", Output),
            ("JTC_DEMO_DIR", Output),
            ("JTC_EXAMPLE_DIR", Output),
            ("JTC_MAN_DIR", Output),
            ("JTC_SIM", Place),
            ("JTC_LISTEN", Place),
            ("JTC_AGENT_NAMES", Place),
            ("JTC_ALLOW_ORIGINS", Place),
            ("JTC_COMMAND_LOG", File),
            ("JTC_COMMAND_LOG_LIMIT", Limit),
            ("JTC_TRAJECTORIES", File),
            ("JTC_TLS_CERT", File),
            ("JTC_TLS_KEY", File),
            ("JTC_RECORD", Output),
            ("JTC_RECORD_LIMIT", Limit),
            ("JTC_MODBUS", Place),
            ("JTC_MODBUS_ALLOW", Place),
            ("JTC_SERIAL", Place),
            ("JTC_BUS", Place),
            ("JTC_SPEED", Simulator),
            ("JTC_SEED", Simulator),
            ("JTC_NO_THROTTLE", Simulator),
            ("JTC_SIM_PAYLOAD", Simulator),
            ("JTC_STORE_FILE", File),
            ("JTC_FAULTS", File),
            ("JTC_SIM_RECORD", Output),
        ];
        // Options for an image, for parameters of a controller and for a motion have no environment variable.
        let without = [
            "recover --arm",
            "traj continue --trajectory",
            "firmware flash --image",
            "firmware verify --image",
        ];
        assert_eq!(faults::<Cli>("JTC_", &VARIABLES, &allowed, &without), [""; 0]);
    }
}
