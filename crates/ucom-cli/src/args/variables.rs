//! Environment variables that `ucom` reads.

use cli_kit::variables::{Retired, Variables};

/// Variables that have an effect, and retired variables of earlier versions.
pub(crate) const VARIABLES: Variables = Variables {
    json: "UCOM_JSON",
    retired: &[
        // These retired variables made a command reset, number, program, start or move boards, override a check, or
        // overwrite a file.
        Retired::less("UCOM_FORCE", "", "force"),
        Retired::less("UCOM_FORCE", "", "overwrite"),
        Retired::less("UCOM_ACTIVE", "run", "active"),
        Retired::less("UCOM_ALIVE", "probe", "alive"),
        Retired::less("UCOM_APPLY", "par", "apply"),
        Retired::less("UCOM_BOARDS", "serve", "boards"),
        Retired::less("UCOM_CLEAR", "status", "clear"),
        Retired::less("UCOM_CONFORMANCE_INIT", "conformance", "init"),
        Retired::less("UCOM_CONFORMANCE_PROGRAM", "conformance", "program"),
        Retired::less("UCOM_CONFORMANCE_RUN", "conformance", "run"),
        Retired::less("UCOM_CONTROL_ONLY", "stop", "control-only"),
        Retired::less("UCOM_DEBUG", "run", "debug"),
        Retired::less("UCOM_FOR", "ci", "for"),
        Retired::less("UCOM_GLOBAL_DEBUG", "run", "global-debug"),
        Retired::less("UCOM_GROUP", "update", "group"),
        Retired::less("UCOM_INIT", "probe", "init"),
        Retired::less("UCOM_INTRUSIVE", "", "intrusive"),
        Retired::less("UCOM_LINK", "serve", "link"),
        Retired::less("UCOM_OUT", "", "out"),
        Retired::less("UCOM_RAW", "status", "raw"),
        Retired::less("UCOM_RAW_IMAGE", "update", "raw"),
        Retired::less("UCOM_RENEW", "init", "renew"),
        Retired::less("UCOM_SET", "status", "set"),
        Retired::less("UCOM_START", "update", "start"),
        Retired::less("UCOM_UNVERIFIED", "update", "unverified"),
        // These retired variables limited a command, or determined the data that the command sent. If such a variable
        // were ignored, the command would do something else than in earlier versions.
        Retired::other("UCOM_ADDRESSES", "update", "addresses"),
        Retired::other("UCOM_CI", "run", "ci"),
        Retired::other("UCOM_COUNT", "", "count"),
        Retired::other("UCOM_DATA", "update", "data"),
        Retired::other("UCOM_DATE", "update", "date"),
        Retired::other("UCOM_EXLOADER", "update", "exloader"),
        Retired::other("UCOM_EXPECT_PROGRAM_ID", "update", "expect-program-id"),
        Retired::other("UCOM_FLASH_ID", "", "flash-id"),
        Retired::other("UCOM_FOR", "run", "for"),
        Retired::other("UCOM_LIVE", "decode", "live"),
        Retired::other("UCOM_NAME_TARGET", "update", "name-target"),
        Retired::other("UCOM_ONLY", "conformance", "only"),
        Retired::other("UCOM_ON_LOST", "run", "on-lost"),
        Retired::other("UCOM_PAR", "run", "par"),
        Retired::other("UCOM_PARAMS", "run", "params"),
        Retired::other("UCOM_SECOND", "update", "second"),
        Retired::other("UCOM_SPEED", "replay", "speed"),
    ],
    offline: &["sim", "explain", "help", "completions", "man"],
};

#[cfg(test)]
mod tests {
    use cli_kit::variables::audit::{Kind, faults};

    use super::*;
    use crate::args::Cli;

    /// A new option must not get a variable that changes boards. Therefore this list contains each permitted
    /// variable, with the reason why it is permitted.
    #[test]
    fn only_places_files_formats_and_harmless_settings_have_a_variable() {
        use Kind::{Caution, File, Format, Limit, Output, Place, Simulator};
        let allowed = [
            ("UCOM_JSON", Format),
            ("UCOM_BUS", Place),
            ("UCOM_PROFILE", File),
            ("UCOM_EDGES", File),
            ("UCOM_INVENTORY", File),
            ("UCOM_CACHE", File),
            ("UCOM_FRESH", Caution),
            ("UCOM_DRY_RUN", Caution),
            ("UCOM_LISTEN_ONLY", Caution),
            ("UCOM_CSV", Format),
            ("UCOM_FOR", Limit),
            ("UCOM_IMAGE", File),
            ("UCOM_SAVE", Output),
            ("UCOM_TEMPLATE", Output),
            ("UCOM_PROBE_OUT", Output),
            ("UCOM_DBC_OUT", Output),
            ("UCOM_MAN_DIR", Output),
            ("UCOM_BOARDS", Simulator),
            ("UCOM_FLASH_IDS", Simulator),
            ("UCOM_SEED", Simulator),
            ("UCOM_CHAIN", File),
            ("UCOM_FAULTS", File),
            ("UCOM_LISTEN", Place),
            ("UCOM_SIM", Place),
            ("UCOM_AGENT_LISTEN", Place),
            ("UCOM_AGENT_NAMES", Place),
            ("UCOM_TOKEN_FILE", File),
            ("UCOM_COMMAND_LOG", File),
            ("UCOM_COMMAND_LOG_LIMIT", Limit),
            ("UCOM_TLS_CERT", File),
            ("UCOM_TLS_KEY", File),
        ];
        // These options have no variable: they select files that are programmed or that contain the inputs of a
        // board, or they change a query into a command.
        let without = [
            "update --exloader",
            "update --data",
            "update --second",
            "par --apply",
            "run --params",
            "conformance --program",
        ];
        assert_eq!(faults::<Cli>("UCOM_", &VARIABLES, &allowed, &without), [""; 0]);
    }
}
