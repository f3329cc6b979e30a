//! Next steps for the user. A next step is a sentence that contains actions. Each front end uses its own name for an
//! action.
use std::borrow::Cow;
use std::fmt;

use serde::{Serialize, Serializer};

/// Front end that shows a next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrontEnd {
    /// Command-line tool.
    Command,
    /// Agent, with its HTTP API and its dashboard.
    Agent,
    /// Python package.
    Python,
}

/// Defines [`Action`] and the names of each action in the front ends.
macro_rules! actions {
    ($($(#[$doc:meta])* $action:ident: $command:literal, $agent:literal, $python:literal;)*) => {
        /// Action or option that a next step names.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Action {
            $($(#[$doc])* $action,)*
        }

        impl Action {
            /// All actions that a next step can name.
            pub const ALL: &[Self] = &[$(Self::$action),*];

            /// Returns the name of the action in a front end: a command, a request with the button of the dashboard, or a Python expression.
            ///
            /// If a front end does not have the action, the name is the command.
            pub const fn name(self, front_end: FrontEnd) -> &'static str {
                match (self, front_end) {
                    $(
                        (Self::$action, FrontEnd::Command) => $command,
                        (Self::$action, FrontEnd::Agent) => $agent,
                        (Self::$action, FrontEnd::Python) => $python,
                    )*
                }
            }
        }
    };
}

actions! {
    /// Upload an arm to the controller.
    ArmPush: "jtc arm push FILE", "PUT /api/arm", "robot.push_arm(arm)";
    /// Upload an arm to the controller and store the arm there.
    ArmStore: "jtc arm push --store", "PUT /api/arm with store: true", "robot.push_arm(arm, store=True)";
    /// Check an arm file.
    ArmCheck: "jtc arm check FILE", "jtc arm check FILE", "openjtc.Arm.load(…).findings()";
    /// Show the values of the arm that the controller uses.
    ArmShow: "jtc arm show", "GET /api/arm/model", "jtc arm show";
    /// Compare an arm file with the arm that the controller uses.
    ArmDiff: "jtc arm diff FILE", "jtc arm diff FILE", "jtc arm diff FILE";
    /// Use the arm that is built into the controller.
    UseDefaults: "jtc params use-defaults", "POST /api/arm/defaults", "robot.use_defaults()";
    /// Upload friction and gains to the controller.
    ParamsPush: "jtc params push FILE", "Recover (POST /api/recover with arm)", "robot.recover(arm=…)";
    /// List the joints that are marked as absent.
    BenchShow: "jtc bench show", "GET /api/absent", "jtc bench show";
    /// Mark all joints as present.
    BenchPresent: "jtc bench present", "PUT /api/absent with absent: []", "jtc bench present";
    /// Acknowledge a held stop and clear errors whose cause no longer exists.
    Clear: "jtc clear", "Acknowledge (POST /api/clear)", "robot.recover()";
    /// Switch off the torque of all joints.
    Disable: "jtc disable", "Take the torque off (POST /api/disable)", "robot.disable()";
    /// Find the cause of a problem.
    Doctor: "jtc doctor", "Look for what is wrong (GET /api/doctor)", "robot.doctor()";
    /// Find the cause of a problem, at the bit rate of the controller.
    DoctorAtRate: "jtc doctor --baud RATE", "jtc serve --baud RATE", "openjtc.connect(…, baud=…)";
    /// Explain states and errors.
    Explain: "jtc explain", "Explain (GET /api/explain)", "jtc explain";
    /// Explain one error code or state.
    ExplainCode: "jtc explain CODE", "Explain (GET /api/explain/{code})", "jtc explain CODE";
    /// Show versions and memory of the controller.
    Info: "jtc info", "GET /api/info", "robot.info";
    /// Jog: move one joint as long as the motion is requested.
    Jog: "jtc jog", "Jog (POST /api/jog)", "robot.jog(…)";
    /// Accept that the limits in the controller differ from the arm file.
    AcceptDeviceLimits: "--accept-device-limits", "accept_device_limits: true", "accept_device_limits=True";
    /// Specify positions in degrees.
    Degrees: "--deg", "degrees: true", "degrees=True";
    /// Take the joints of a file in the order of the numbers in their names.
    JointsByNumber: "--joints-by-number", "joints_by_number: true", "openjtc.Trajectory.load(…, joints_by_number=True)";
    /// Choose the bit rate of the serial line.
    Baud: "--baud", "jtc serve --baud", "baud=";
    /// Monitor the state and the connection.
    Monitor: "jtc monitor", "GET /metrics", "robot.doctor()";
    /// Show the payload.
    PayloadShow: "jtc payload show", "GET /api/payload", "robot.payload";
    /// Set the payload.
    PayloadSet: "jtc payload set", "Payload (PUT /api/payload)", "robot.payload = …";
    /// Remove the payload.
    PayloadClear: "jtc payload clear", "Payload (PUT /api/payload with mass_kg: 0 and com_m: [0, 0, 0])", "robot.payload = None";
    /// Return to position hold from any state.
    Recover: "jtc recover", "Recover (POST /api/recover with {})", "robot.recover()";
    /// Return to position hold and upload this arm to the controller.
    RecoverWithArm: "jtc recover --arm FILE", "Recover (POST /api/recover with arm)", "robot.recover(arm=…)";
    /// Return to position hold and use the arm that is built into the controller.
    RecoverWithDefaults:
        "jtc recover --defaults", "Recover (POST /api/recover with defaults: true)", "robot.recover(defaults=True)";
    /// Restart a drive.
    ResetJoint:
        "jtc reset --joints JOINT", "POST /api/reset with joints: [JOINT]", "`jtc reset --joints JOINT` after `robot.close()`";
    /// Restart drives although the arm may fall.
    ResetMayFall: "jtc reset --yes", "POST /api/reset with arm_may_fall: true", "jtc reset --yes";
    /// Show the state.
    Status: "jtc status", "GET /api/status", "robot.status";
    /// End Teaching.
    TeachOff:
        "jtc teach off", "End teaching (POST /api/teach with on: false)", "end the block `with robot.teach():`";
    /// Record a motion for which the user guides the arm by hand.
    TeachRecord: "jtc teach record FILE", "jtc teach record FILE", "robot.teach()";
    /// Check a trajectory.
    TrajCheck: "jtc traj check FILE", "GET /api/trajectories/{number}/check", "robot.check(…)";
    /// Run a trajectory.
    TrajRun: "jtc traj run FILE", "Run (POST /api/runs)", "robot.run(…)";
    /// Move to the first point and run a trajectory.
    TrajRunWithApproach:
        "jtc traj run FILE --approach", "Run (POST /api/runs with approach: true)", "robot.run(…, approach=True)";
    /// Run a trajectory at a lower speed.
    TrajRunSlower: "jtc traj run FILE --speed PCT", "Run (POST /api/runs with speed_percent)", "robot.run(…, speed=…)";
    /// Pause the motion.
    Pause: "jtc traj pause", "Pause (POST /api/pause)", "robot.pause()";
    /// Resume the motion.
    Resume: "jtc traj resume", "Resume (POST /api/resume)", "robot.resume()";
    /// End the motion.
    Stop: "jtc traj stop", "Stop (POST /api/stop)", "robot.stop()";

    /// List the boards of the chain.
    ChainScan: "ucom scan", "Scan (POST /api/scan)", "ucom scan";
    /// Give a number to each board of the chain.
    ChainInit: "ucom init", "Number the chain (POST /api/init)", "ucom init";
    /// Find the cause of a problem on the bus or in a board.
    ChainDoctor: "ucom doctor", "Look for what is wrong (POST /api/doctor)", "ucom doctor";
    /// Stop all boards.
    ChainStop: "ucom stop all", "Stop (POST /api/stop)", "ucom stop all";
    /// Show identity and program of a board.
    BoardInfo: "ucom info {number}", "GET /api/boards/{number}", "ucom info {number}";
    /// Show names, ranges and values of a board's inputs, outputs and parameters.
    BoardValues: "ucom io {number}", "GET /api/boards/{number}/values", "ucom io {number}";
    /// Show the state of a board.
    BoardStatus: "ucom status {number}", "GET /api/boards/{number}", "ucom status {number}";
    /// Start the application of a board.
    BoardStart: "ucom start {number}", "Start (POST /api/boards/{number}/start)", "ucom start {number}";
    /// Start the control loop of a board.
    BoardRun: "ucom run {number}", "Run (POST /api/run)", "ucom run {number}";
    /// End the application of a board.
    BoardStop: "ucom stop {number}", "Stop application (POST /api/boards/{number}/stop)", "ucom stop {number}";
    /// Reboot a board.
    BoardReset: "ucom reset {number}", "Reset (POST /api/boards/{number}/reset)", "ucom reset {number}";
    /// Write an image to a board.
    BoardUpdate: "ucom update {number} IMAGE", "Update (POST /api/updates)", "ucom update {number} IMAGE";
}

/// Placeholder of a board number in the name of an action.
const NUMBER: &str = "{number}";

/// Part of a next step.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    /// Words that all front ends show unchanged. Commands in these words are enclosed in backticks.
    Words(Cow<'static, str>),
    /// Action, for which each front end shows its own name.
    Action {
        action: Action,
        /// Complete command with all arguments. The command-line tool shows it instead of the name of the action.
        command: Option<String>,
        /// Boards whose numbers replace the placeholder in the name; empty if they are not known.
        boards: Vec<u8>,
    },
}

/// Sentence about the next step, without a full stop; empty if no step helps.
///
/// [`next!`](crate::next!) creates a sentence that contains actions. The [`Display`](fmt::Display) form is the sentence
/// for the command line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Next(Vec<Part>);

impl Next {
    /// Returns `true` if no step helps.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Counts the placeholders `{}` in a sentence.
    #[doc(hidden)]
    pub const fn places(sentence: &str) -> usize {
        let bytes = sentence.as_bytes();
        let (mut i, mut count) = (1, 0);
        while i < bytes.len() {
            count += (bytes[i - 1] == b'{' && bytes[i] == b'}') as usize;
            i += 1;
        }
        count
    }

    /// Replaces each placeholder `{}` of a sentence by an action.
    #[doc(hidden)]
    pub fn filled(sentence: &'static str, actions: &[Action]) -> Self {
        let mut pieces = sentence.split("{}").map(Self::from);
        let first = pieces.next().unwrap_or_default();
        pieces.zip(actions).fold(first, |next, (piece, &action)| next.then(action).then(piece))
    }

    /// Returns `true` if the sentence contains this action.
    pub fn names(&self, wanted: Action) -> bool {
        self.0.iter().any(|part| matches!(part, Part::Action { action, .. } if *action == wanted))
    }

    /// Sets the command of an action, with all arguments. The command applies to every occurrence of the action in the
    /// sentence.
    #[must_use]
    pub fn with_command(mut self, wanted: Action, command: &str) -> Self {
        for part in &mut self.0 {
            if let Part::Action { action, command: typed, .. } = part
                && *action == wanted
            {
                *typed = Some(command.to_owned());
            }
        }
        self
    }

    /// Sets the board of all actions of the sentence that concern one board.
    #[must_use]
    pub fn of_board(self, board: u8) -> Self {
        self.of_boards(&[board])
    }

    /// Sets the boards of all actions of the sentence that concern boards.
    #[must_use]
    pub fn of_boards(mut self, numbers: &[u8]) -> Self {
        for part in &mut self.0 {
            if let Part::Action { boards, .. } = part {
                *boards = numbers.to_vec();
            }
        }
        self
    }

    /// Adds words or an action at the end.
    #[must_use]
    pub fn then(mut self, more: impl Into<Self>) -> Self {
        self.0.extend(more.into().0);
        self
    }

    /// Creates a next step that consists of one action. The command-line tool shows `command`, which contains all
    /// arguments.
    pub fn typed(action: Action, command: impl Into<String>) -> Self {
        Self(vec![Part::Action { action, command: Some(command.into()), boards: Vec::new() }])
    }

    /// Returns the sentence for a front end, with commands, requests and expressions in backticks.
    pub fn sentence(&self, front_end: FrontEnd) -> String {
        let parts = self.0.iter().map(|part| match part {
            Part::Words(words) => words.clone(),
            Part::Action { command: Some(command), .. } if front_end == FrontEnd::Command => {
                format!("`{command}`").into()
            }
            Part::Action { action, boards, .. } => {
                let numbers = match (boards.as_slice(), front_end) {
                    // A request of the agent addresses exactly one board. For no board or several boards, the
                    // placeholder stays.
                    ([] | [_, _, ..], FrontEnd::Agent) => NUMBER.to_owned(),
                    ([], _) => "N".to_owned(),
                    (boards, _) => boards.iter().map(u8::to_string).collect::<Vec<_>>().join(","),
                };
                let name = action.name(front_end).replace(NUMBER, &numbers);
                // Some names already contain an expression in backticks, so they get no further backticks.
                if name.contains('`') { name.into() } else { format!("`{name}`").into() }
            }
        });
        parts.collect()
    }

    /// Returns the sentence for a front end without backticks.
    pub fn plain(&self, front_end: FrontEnd) -> String {
        self.sentence(front_end).replace('`', "")
    }
}

impl fmt::Display for Next {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence(FrontEnd::Command))
    }
}

impl Serialize for Next {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl From<Action> for Next {
    fn from(action: Action) -> Self {
        Self(vec![Part::Action { action, command: None, boards: Vec::new() }])
    }
}

impl From<&'static str> for Next {
    fn from(words: &'static str) -> Self {
        Cow::Borrowed(words).into()
    }
}

impl From<String> for Next {
    fn from(words: String) -> Self {
        Cow::<'static, str>::Owned(words).into()
    }
}

impl From<Cow<'static, str>> for Next {
    fn from(words: Cow<'static, str>) -> Self {
        if words.is_empty() { Self::default() } else { Self(vec![Part::Words(words)]) }
    }
}

/// Creates a [`Next`] from a sentence. The macro replaces each `{}` of the sentence by one of the [`Action`]s that
/// follow the sentence, in their order.
#[macro_export]
macro_rules! next {
    ($sentence:literal $(, $action:ident)* $(,)?) => {{
        const ACTIONS: &[$crate::Action] = &[$($crate::Action::$action),*];
        const { assert!($crate::Next::places($sentence) == ACTIONS.len(), "as many actions as places") };
        $crate::Next::filled($sentence, ACTIONS)
    }};
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_front_end_names_the_action_in_its_words() {
        let next = next!("free it, then {}; ", Clear).then("else `ls`");
        assert_eq!(next.to_string(), "free it, then `jtc clear`; else `ls`");
        assert_eq!(next.sentence(FrontEnd::Python), "free it, then `robot.recover()`; else `ls`");
        assert_eq!(next.plain(FrontEnd::Agent), "free it, then Acknowledge (POST /api/clear); else ls");
        let check = Next::typed(Action::TrajCheck, "jtc traj check a.csv --speed 50");
        assert_eq!(check.to_string(), "`jtc traj check a.csv --speed 50`");
        assert_eq!(check.sentence(FrontEnd::Python), "`robot.check(…)`");
        assert!(check.names(Action::TrajCheck) && !check.names(Action::TrajRun));
        let run = next!("then {}", TrajRun).with_command(Action::TrajRun, "jtc traj run 'my motion.csv'");
        assert_eq!(run.to_string(), "then `jtc traj run 'my motion.csv'`");
        let start = next!("{} first", BoardStart);
        assert_eq!(start.to_string(), "`ucom start N` first");
        let start = start.of_board(2);
        assert_eq!(start.to_string(), "`ucom start 2` first");
        assert_eq!(start.plain(FrontEnd::Agent), "Start (POST /api/boards/2/start) first");
        let stop = Next::from(Action::BoardStop).of_boards(&[1, 3]);
        assert_eq!(stop.to_string(), "`ucom stop 1,3`");
        assert_eq!(stop.plain(FrontEnd::Agent), "Stop application (POST /api/boards/{number}/stop)");
        let block = Next::from(Action::TeachOff).sentence(FrontEnd::Python);
        assert_eq!(block, "end the block `with robot.teach():`");
    }

    #[test]
    fn each_expression_of_python_exists() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../openjtc-py/python/openjtc");
        let files = std::fs::read_dir(folder).expect("the Python package");
        let paths = files.map(|file| file.expect("a file").path()).filter(|path| path.is_file());
        let source: String = paths.map(|path| std::fs::read_to_string(path).expect("text")).collect();
        let word =
            |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        for action in Action::ALL {
            let name = action.name(FrontEnd::Python);
            for method in name.split("robot.").skip(1).chain(name.split("openjtc.").skip(1)).map(word) {
                let defined =
                    [format!("def {method}("), format!("class {method}:"), format!("class {method}(")];
                assert!(defined.iter().any(|definition| source.contains(definition)), "{action:?}: {method}");
            }
        }
    }

    #[test]
    fn no_words_are_no_step() {
        assert!(Next::default().is_empty() && Next::from("").is_empty());
        assert!(!Next::from(Action::Stop).is_empty() && !Next::from("wait").is_empty());
    }

    #[test]
    fn no_two_actions_have_the_same_command() {
        let commands: Vec<_> = Action::ALL.iter().map(|action| action.name(FrontEnd::Command)).collect();
        for (i, command) in commands.iter().enumerate() {
            assert!(!commands[..i].contains(command), "{command}");
        }
    }
}
