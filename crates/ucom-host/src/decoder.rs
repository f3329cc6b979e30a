//! Describes frames as text. The decoder remembers the previous frames of an answer, because a later package can look
//! like the first frame of an answer.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use ucom::{
    Assembled, BoardInfo, Dimensions, Foreign, Frame, FromBoard, Function, Latin1, Profile, Sender, Sequence,
    StringAssembler, ToBoard,
};

/// Description of a frame as text and JSON.
pub struct Described {
    /// Function of the frame, or the reason why the frame is not a frame of this protocol.
    pub name: String,
    /// Sender of the frame: `PC`, `board 3`, or both if the identifier does not show the sender.
    pub who: String,
    /// Contents of the frame as text.
    pub text: String,
    /// Contents of the frame as JSON.
    pub value: Value,
}

/// Decoder for the frames on a bus. The caller must pass the frames in the order in which they were received.
pub struct Decoder {
    profile: Profile,
    answers: BTreeMap<(Function, Sequence), Answer>,
}

/// Received frames of an answer that consists of several frames.
struct Answer {
    strings: Box<StringAssembler>,
    /// Number of strings of the answer that are still missing; `None` before the first frame.
    left: Option<u32>,
    last_us: u64,
}

impl Decoder {
    /// Creates a decoder for boards with this profile.
    pub fn new(profile: Profile) -> Self {
        Self { profile, answers: BTreeMap::new() }
    }

    /// Returns the description of a frame.
    pub fn describe(&mut self, now_us: u64, frame: &Result<Frame, Foreign>) -> Described {
        let frame = match frame {
            Ok(frame) => frame,
            Err(why) => return foreign(*why),
        };
        let (function, sequence) = match frame.address() {
            Ok(address) => address,
            Err(why) => return foreign(why),
        };
        let from_pc = match function.sender() {
            Sender::Pc => Some(true),
            Sender::Board => Some(false),
            // An MCA_DUMP_IO_DESCRIPTION frame with data is always the answer of a board (D-12). Only the PC sends broadcasts (D-05).
            Sender::Both if function == Function::DumpIo => Some(frame.dlc() == 0),
            Sender::Both if Some(sequence) == self.profile.broadcast_number() => Some(true),
            Sender::Both => None,
        };
        let who = self.who(from_pc, sequence);
        let (text, value) = match from_pc {
            Some(true) => self.pc_message(frame),
            _ => self.board_message(now_us, function, sequence, frame),
        };
        let name = function.name().to_owned();
        Described { name, who, text, value }
    }

    fn who(&self, from_pc: Option<bool>, sequence: Sequence) -> String {
        let board = if sequence == self.profile.unnumbered() && !self.profile.is_board(sequence) {
            if from_pc == Some(true) { "all".to_owned() } else { "board without a number".to_owned() }
        } else {
            format!("board {sequence}")
        };
        match from_pc {
            Some(true) => format!("PC > {board}"),
            Some(false) => board,
            None => format!("PC or {board}"),
        }
    }

    fn pc_message(&self, frame: &Frame) -> (String, Value) {
        let (_, message) = match ToBoard::decode(frame, &self.profile) {
            Ok(message) => message,
            Err(e) => return (e.to_string(), json!({ "malformed": e.to_string() })),
        };
        match message {
            ToBoard::SetStatus { mask, value } => {
                let (mask, value) = (ucom::Status(mask), ucom::Status(value));
                let text = format!("set {value}, clear {}", mask & !value);
                (text, json!({ "mask": mask.0, "value": value.0 }))
            }
            ToBoard::Prog(data) => (hex(&data), json!({ "data": hex(&data) })),
            ToBoard::Ci(p) | ToBoard::Par(p) => package(&p),
            ToBoard::Admin(admin) => (admin.to_string(), admin_value(admin)),
            _ => (String::new(), json!({})),
        }
    }

    fn board_message(
        &mut self,
        now_us: u64,
        function: Function,
        at: Sequence,
        frame: &Frame,
    ) -> (String, Value) {
        let (_, message) = match FromBoard::decode(frame, &self.profile) {
            Ok(message) => message,
            Err(e) => return (e.to_string(), json!({ "malformed": e.to_string() })),
        };
        match message {
            FromBoard::Error(code) => (
                format!("{code}: {}", code.meaning()),
                json!({ "error": code.number(), "error_name": code.name() }),
            ),
            FromBoard::InitAck(number) => (format!("is number {number}"), json!({ "number": number })),
            FromBoard::Report(report) => {
                let odd = if report.agrees() { "" } else { ", identifier differs" };
                (format!("flash id 0x{:02X}{odd}", report.ucom_id), json!({ "flash_id": report.ucom_id }))
            }
            FromBoard::So(p) | FromBoard::Ci(p) => package(&p),
            FromBoard::Admin(admin) => (admin.to_string(), admin_value(admin)),
            FromBoard::Info(_) | FromBoard::IoDescription(_) | FromBoard::Debug(_) => {
                self.answer(now_us, function, at, frame)
            }
            FromBoard::ProgFinished | FromBoard::Ready | FromBoard::McaReady | FromBoard::Alive => {
                (String::new(), json!({}))
            }
        }
    }

    /// Describes a frame of DSP_INFO, of the IO description, or of a debug text.
    fn answer(&mut self, now_us: u64, function: Function, at: Sequence, frame: &Frame) -> (String, Value) {
        let profile = self.profile;
        let answer = self.answers.entry((function, at)).or_insert_with(|| Answer {
            strings: Box::new(StringAssembler::new()),
            left: None,
            last_us: now_us,
        });
        if now_us.saturating_sub(answer.last_us) > profile.string_gap_us() {
            answer.strings.reset();
            answer.left = None;
        }
        answer.last_us = now_us;
        let payload = frame.payload();
        if answer.left.is_none() {
            answer.left = Some(1);
            match function {
                Function::DspInfo => {
                    if let Some(info) = BoardInfo::parse(&payload, profile.endian) {
                        return info_words(&info, &profile);
                    }
                }
                Function::DumpIo => {
                    if let Some(d) = Dimensions::parse(&payload, profile.endian) {
                        answer.left = Some(d.strings());
                        let text = format!("{} inputs, {} outputs, {} parameters", d.ci, d.so, d.par);
                        return (text, json!({ "ci": d.ci, "so": d.so, "par": d.par }));
                    }
                }
                _ => {}
            }
        }
        let raw = Latin1(frame.data()).to_string();
        let complete = match answer.strings.push(now_us, &payload, &profile) {
            Assembled::Complete(text) => Some(text.to_string()),
            Assembled::Partial | Assembled::Refused => None,
        };
        match complete {
            Some(text) => {
                answer.left = answer.left.map(|left| left.saturating_sub(1)).filter(|left| *left > 0);
                (format!("\"{text}\""), json!({ "text": text }))
            }
            _ if answer.strings.is_open() && frame.dlc() == 2 => (
                format!("text of {} packages", answer.strings.missing()),
                json!({ "packages": answer.strings.missing() }),
            ),
            _ => (format!("… {raw}"), json!({ "part": raw })),
        }
    }
}

fn foreign(why: Foreign) -> Described {
    Described {
        name: "foreign".into(),
        who: "-".into(),
        text: why.to_string(),
        value: json!({ "foreign": why.to_string() }),
    }
}

fn info_words(info: &BoardInfo, profile: &Profile) -> (String, Value) {
    let program = if info.has_application() {
        format!("program 0x{:04X}", info.program_id)
    } else {
        "no application".to_owned()
    };
    let text =
        format!("flash 0x{:04X}, number {}, {}, {program}", info.flash_number, info.sequence, info.status);
    let value = json!({
        "flash_number": info.flash_number,
        "number": info.sequence,
        "status": info.status.0,
        "program_id": info.program_id,
        "date": info.date,
        "flash_date": info.has_application().then(|| date_text(profile, info.date)),
    });
    (text, value)
}

fn package(p: &ucom::BufferPackage) -> (String, Value) {
    let words = p.words.get(..usize::from(p.count)).unwrap_or(&p.words);
    let signed: Vec<i16> = words.iter().map(|w| *w as i16).collect();
    let list: Vec<String> = signed.iter().map(i16::to_string).collect();
    (format!("from {}: {}", p.offset, list.join(" ")), json!({ "offset": p.offset, "words": signed }))
}

fn admin_value(admin: ucom::Admin) -> Value {
    json!({ "run": admin.run, "active": admin.active, "debug": admin.debug, "global_debug": admin.global_debug })
}

/// Returns bytes as hexadecimal text in the form `11 22`.
pub(crate) fn hex(bytes: &[u8]) -> String {
    let all: Vec<String> = bytes.iter().map(|b| format!("{b:02X}")).collect();
    all.join(" ")
}

/// Returns a flash date as text, such as `2026-05-04`. If the number is not a date in the format of the profile, the function returns the
/// number as text.
pub fn date_text(profile: &Profile, date: u16) -> String {
    match profile.prog_date.decode(date) {
        Some((year, month, day)) => format!("{year:04}-{month:02}-{day:02}"),
        None => format!("0x{date:04X}"),
    }
}
