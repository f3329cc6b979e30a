use clap::{CommandFactory, Parser};

use super::audit::{Kind, faults};
use super::*;

/// Command line for the tests.
#[derive(Debug, clap::Parser)]
#[command(name = "try")]
struct Cli {
    /// JSON
    #[arg(long, global = true, env = "TRY_JSON", value_parser = on_off)]
    json: bool,
    /// The bus
    #[arg(long, global = true, env = "TRY_BUS", value_name = "URL")]
    bus: Option<String>,
    #[command(subcommand)]
    command: Commands,
}

#[derive(Debug, clap::Subcommand)]
enum Commands {
    /// Goes
    Go {
        /// Its speed
        #[arg(long, value_name = "N", default_value_t = 3)]
        speed: u8,
        /// Outputs are enabled
        #[arg(long)]
        active: bool,
        /// Written
        #[arg(long, env = "TRY_GO_OUT", value_name = "FILE")]
        out: Option<String>,
    },
    /// Explains
    Explain,
}

const VARIABLES: Variables = Variables {
    json: "TRY_JSON",
    retired: &[
        Retired::other("TRY_SPEED", "go", "speed"),
        Retired::less("TRY_ACTIVE", "", "active"),
        Retired::less("TRY_OUT", "", "out"),
    ],
    offline: &["explain"],
};

const ALLOWED: [(&str, Kind); 3] =
    [("TRY_JSON", Kind::Format), ("TRY_BUS", Kind::Place), ("TRY_GO_OUT", Kind::Output)];

fn report(words: &[&str], environment: &[(&str, &str)]) -> Report {
    let mut root = Cli::command();
    let matches = root.try_get_matches_from_mut([&["try"], words].concat()).unwrap();
    VARIABLES.report("try", &root, &matches, of(environment))
}

fn of<'a>(environment: &'a [(&str, &str)]) -> impl Fn(&str) -> Option<OsString> + Copy + 'a {
    move |name| environment.iter().find(|(other, _)| *other == name).map(|(_, value)| value.into())
}

#[test]
fn on_and_off_are_eight_words_in_any_letter_case() {
    for (words, value) in [
        (["1", "true", "yes", "on", "YES", "True", "oN"], true),
        (["0", "false", "no", "off", "OFF", "No", ""], false),
    ] {
        words.iter().for_each(|word| assert_eq!(on_off(word), Ok(value), "{word}"));
    }
    for wrong in ["x", "2", "y", "n", "t", "f", " 1", "1 ", "-1", "01", "enable", "true,"] {
        assert!(on_off(wrong).unwrap_err().contains("1, true, yes or on"), "{wrong}");
    }
}

#[test]
fn variables_of_options_that_act_are_named_and_ignored_or_refused() {
    let all = [("TRY_ACTIVE", "x"), ("TRY_OUT", "a\u{1b}[2J\nb")];
    let found = report(&["go"], &all);
    assert!(found.refused.is_none() && found.in_effect.is_none());
    assert_eq!(
        found.ignored,
        [
            "try: TRY_ACTIVE=x is ignored: `try go` does not read this variable; use --active",
            "try: TRY_OUT=a\\u{1b}[2J\\nb is ignored: `try go` does not read this variable; use --out or TRY_GO_OUT"
        ]
    );
    let refused = report(&["go"], &[("TRY_SPEED", "9")]).refused.unwrap();
    assert_eq!(
        (crate::exit::of(refused.kind), refused.next.to_string().as_str()),
        (2, "use --speed, or unset TRY_SPEED")
    );
    assert!(refused.message.contains("TRY_SPEED=9") && refused.message.contains("`try go`"), "{refused:?}");
    // In each of these cases, the variable is neither reported nor refused: the option is typed, the variable is off,
    // the variable is empty, or the variable belongs to another command.
    for (words, environment) in [
        (&["go", "--speed", "2"][..], &[("TRY_SPEED", "9")][..]),
        (&["go", "--active"], &[("TRY_ACTIVE", "1")]),
        (&["go"], &[("TRY_ACTIVE", "off"), ("TRY_SPEED", "")]),
        (&["explain"], &[("TRY_SPEED", "9"), ("TRY_ACTIVE", "1"), ("TRY_OUT", "x")]),
    ] {
        let found = report(words, environment);
        assert!(found.refused.is_none() && found.ignored.is_empty(), "{words:?}: {found:?}");
    }
}

#[test]
fn where_a_command_line_is_wrong_the_variable_behind_it_is_named() {
    let lines = |words: &[&str], environment: &[(&str, &str)]| {
        let root = Cli::command();
        let error = Cli::try_parse_from([&["try"], words].concat()).unwrap_err();
        let typed: Vec<OsString> = words.iter().map(OsString::from).collect();
        VARIABLES.report_error("try", &root, &error, &typed, of(environment))
    };
    // The variables are passed as an argument and are not set in the process, so clap does not read them. The parser
    // rejects the wrong option `--sped`. The report must still list the variable.
    assert_eq!(lines(&["go", "--sped", "3"], &[("TRY_ACTIVE", "1")]).len(), 1);
    assert!(lines(&["go", "--bus"], &[("TRY_BUS", "x")]).is_empty(), "it is typed");
}

/// The audit finds each possible fault of an option.
#[test]
fn the_audit_finds_options_that_must_not_have_a_variable() {
    assert_eq!(faults::<Cli>("TRY_", &VARIABLES, &ALLOWED, &[]), [""; 0]);
    assert_eq!(faults::<Cli>("TRY_", &VARIABLES, &ALLOWED[..2], &[]).len(), 1, "not in the list");
    let as_file = [ALLOWED[0], ALLOWED[1], ("TRY_GO_OUT", Kind::Caution)];
    assert_eq!(faults::<Cli>("TRY_", &VARIABLES, &as_file, &[]).len(), 1, "another kind");
    let one_more = [&ALLOWED[..], &[("TRY_GONE", Kind::File)]].concat();
    assert_eq!(faults::<Cli>("TRY_", &VARIABLES, &one_more, &[]).len(), 1, "no option");
    assert_eq!(faults::<Cli>("TRX_", &VARIABLES, &ALLOWED, &[]).len(), 3, "another program's");
    assert_eq!(faults::<Cli>("TRY_", &VARIABLES, &ALLOWED, &["go --out"]).len(), 1, "listed without");
    const RETIRED: &[Retired] = &[Retired::less("TRY_BUS", "", "bus")];
    let wrong = Variables { retired: RETIRED, offline: &["go away"], ..VARIABLES };
    assert_eq!(faults::<Cli>("TRY_", &wrong, &ALLOWED, &[]).len(), 2);

    const AGAIN: &[Retired] = &[Retired::less("TRY_GO_OUT", "go", "out")];
    let again = faults::<Cli>("TRY_", &Variables { retired: AGAIN, ..VARIABLES }, &ALLOWED, &[]);
    assert!(
        again.iter().any(|fault| fault == "go --out: it reads TRY_GO_OUT, which is retired"),
        "{again:?}"
    );

    #[derive(clap::Parser)]
    struct Dangerous {
        /// Enables outputs
        #[arg(long, env = "TRY_ACTIVE", value_parser = clap::builder::FalseyValueParser::new())]
        active: bool,
        /// Read
        #[arg(long, value_name = "FILE")]
        table: Option<String>,
        #[command(subcommand)]
        command: Two,
    }
    #[derive(clap::Subcommand)]
    enum Two {
        /// A
        A {
            /// Written by a
            #[arg(long, env = "TRY_OUT", value_name = "FILE")]
            out: Option<String>,
        },
        /// B
        B {
            /// Written by b
            #[arg(long, env = "TRY_OUT", value_name = "FILE")]
            out: Option<String>,
        },
    }
    let variables = Variables { retired: &[], offline: &[], ..VARIABLES };
    let found = faults::<Dangerous>("TRY_", &variables, &[("TRY_OUT", Kind::Output)], &[]);
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found[0].contains("TRY_ACTIVE is not in the list"), "{found:?}");
    assert!(found[1].contains("--table: it names a place"), "{found:?}");
    assert!(found[2].contains("two meanings: a --out and b --out"), "{found:?}");
}
