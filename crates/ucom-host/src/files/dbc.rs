//! Writes DBC files for cantools, SavvyCAN and similar tools. A DBC file describes the frames of the protocol. For
//! boards whose description is known, it also contains the names of their inputs, outputs and parameters.
//!
//! CI, SO and PAR frames are multiplexed by their buffer offset: the first word of the frame shows which three words
//! of the buffer follow (D-15). Packages of strings have the same identifiers as other frames, and their content does
//! not distinguish them from those frames. Therefore the DBC file describes only the first frame of DSP_INFO and of
//! the IO description. The file describes debug texts and program data as raw bytes.
mod names;
#[cfg(test)]
mod tests;

use std::fmt::Write;

use super::signals::{BoardSignals, Signal, SignalType};
use crate::master::io::{IoDescription, Kind, short};
use names::Names;
use ucom::{Endian, Function, Sender, Sequence, Status};

/// Input, output or parameter of a board.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedSignal {
    /// Name of the signal. In the DBC file, the name is converted to an identifier.
    pub name: String,
    /// Type, scale, offset and unit of the 16-bit word that carries this signal (D-11).
    pub signal: Signal,
}

/// Board whose process data are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DbcBoard {
    /// Board number.
    pub number: u8,
    /// Controller inputs of the board, in the order of the buffer.
    pub ci: Vec<NamedSignal>,
    /// Sensor outputs of the board, in the order of the buffer.
    pub so: Vec<NamedSignal>,
    /// Parameters of the board, in the order of the buffer.
    pub par: Vec<NamedSignal>,
}

impl DbcBoard {
    /// Creates a board with the names of its signals and the meanings of their words.
    pub fn new(number: u8, description: &IoDescription, signals: &BoardSignals) -> Self {
        let of = |kind: Kind| {
            let pairs = description.names(kind).iter().zip(signals.all(kind));
            pairs
                .map(|(name, signal)| NamedSignal { name: short(name).into(), signal: signal.clone() })
                .collect()
        };
        Self { number, ci: of(Kind::Ci), so: of(Kind::So), par: of(Kind::Par) }
    }
}

/// Signal of a DBC message.
struct DbcSignal {
    name: String,
    /// First byte of the signal.
    byte: usize,
    /// First bit in the first byte, for fields that are shorter than a byte.
    bit: usize,
    bits: usize,
    signed: bool,
    /// DBC multiplexer mark: ` M`, ` m3`, or empty.
    multiplex: String,
    /// Scale, offset and unit of the signal, if they are known.
    signal: Option<Signal>,
}

impl DbcSignal {
    fn field(name: &str, byte: usize, bits: usize) -> Self {
        Self { name: name.into(), byte, bit: 0, bits, signed: false, multiplex: String::new(), signal: None }
    }

    fn line(&self, endian: Endian, receiver: &str) -> String {
        // In Motorola order, the start bit of a field is its most significant bit, which is in the first byte of the field.
        let big = endian == Endian::Big && self.bits > 8;
        let start = self.byte * 8 + if big { 7 } else { self.bit };
        let (order, sign) = (u8::from(!big), if self.signed { '-' } else { '+' });
        let (low, high) = match (self.signed, self.bits) {
            (true, _) => (-32768_i64, 32767),
            (false, 64) => (0, 0),
            (false, bits) => (0, (1_i64 << bits) - 1),
        };
        let Self { name, multiplex, bits, signal, .. } = self;
        let (scale, offset, unit) = signal.as_ref().map_or((1.0, 0.0, ""), |e| (e.scale, e.offset, &e.unit));
        // The file contains the limit with as few digits as possible, without rounding errors.
        let limit = |text: String| text.parse::<f64>().map_or(text, |n| n.to_string());
        let (low, high) = match signal {
            Some(signal) if signal.known && signal.kind != SignalType::Hex => {
                let (low, high) = signal.limits();
                (limit(low), limit(high))
            }
            _ => (low.to_string(), high.to_string()),
        };
        format!(
            " SG_ {name}{multiplex} : {start}|{bits}@{order}{sign} ({scale},{offset}) [{low}|{high}] \"{unit}\" {receiver}\n"
        )
    }
}

/// Returns the text of a DBC file for these boards; `endian` is the byte order of the boards' words.
///
/// Boards with numbers above 31 are omitted from the file. The broadcasts of the PC are always part of the file.
pub fn dbc(boards: &[DbcBoard], endian: Endian) -> String {
    let mut boards: Vec<(&DbcBoard, Sequence)> = boards
        .iter()
        .filter_map(|b| Some((b, Sequence::new(b.number).filter(|n| n.number() > 0)?)))
        .collect();
    boards.sort_by_key(|(_, number)| *number);
    boards.dedup_by_key(|(_, number)| *number);
    let mut text = String::from("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: PC UCOM");
    for (_, number) in &boards {
        let _ = write!(text, " UCOM{number}");
    }
    text.push_str("\n\n");
    let mut comments = String::new();
    for function in Function::ALL {
        if function.from_pc() && function.broadcast() {
            message(&mut text, function, Sequence::ZERO, fields(function), endian);
            comment(&mut comments, function, Sequence::ZERO, "to all boards");
        } else if function == Function::Error {
            message(&mut text, function, Sequence::ZERO, fields(function), endian);
            comment(&mut comments, function, Sequence::ZERO, "from a board without a number");
        }
    }
    for k in 0..4 {
        let Some(function) = Function::report(k) else { continue };
        for number in Sequence::all() {
            message(&mut text, function, number, fields(function), endian);
        }
    }
    for (board, number) in &boards {
        for function in Function::ALL {
            let signals = match function {
                Function::Ci => multiplexed(&board.ci, "ci"),
                Function::DspCi => multiplexed(&board.ci, "initial_ci"),
                Function::So => multiplexed(&board.so, "so"),
                Function::Par => multiplexed(&board.par, "par"),
                Function::Report0 | Function::Report1 | Function::Report2 | Function::Report3 => continue,
                _ => fields(function),
            };
            message(&mut text, function, *number, signals, endian);
            comment(&mut comments, function, *number, "");
        }
    }
    text.push_str(&comments);
    let codes = ucom::ErrorCode::ALL.map(|code| format!(" {} \"{}\"", code.number(), code.name())).concat();
    for number in [Sequence::ZERO].into_iter().chain(boards.iter().map(|(_, number)| *number)) {
        let _ = writeln!(text, "VAL_ {} code{codes} ;", Function::Error.id(number));
    }
    text
}

/// Returns the fields in the frames of a function, for functions whose frames have the same layout on all boards.
fn fields(function: Function) -> Vec<DbcSignal> {
    let status = |byte| {
        let bits = Status::NAMES.iter().enumerate();
        bits.map(move |(i, (name, _))| DbcSignal {
            bit: 7 - i,
            ..DbcSignal::field(&name.to_ascii_lowercase(), byte, 1)
        })
    };
    let word = |name: &str, byte| DbcSignal::field(name, byte, 16);
    match function {
        Function::Error => vec![DbcSignal::field("code", 0, 8)],
        Function::InitAck => vec![DbcSignal::field("sequence", 0, 8)],
        Function::SetStatus => {
            let mut signals = vec![DbcSignal::field("mask", 0, 8)];
            signals.extend(status(1));
            signals
        }
        Function::DspInfo => {
            let mut signals = vec![word("flash_number", 0), DbcSignal::field("sequence", 2, 8)];
            signals.extend(status(3));
            signals.extend([word("program_id", 4), word("flash_date", 6)]);
            signals
        }
        Function::Report0 | Function::Report1 | Function::Report2 | Function::Report3 => {
            vec![DbcSignal::field("ucom_id", 0, 8)]
        }
        Function::DumpIo => vec![word("ci", 0), word("so", 2), word("par", 4)],
        Function::Admin => {
            let names = ["run", "active", "debug", "global_debug"];
            names.iter().enumerate().map(|(i, name)| DbcSignal::field(name, i, 8)).collect()
        }
        Function::Prog | Function::Debug => {
            (0..8).map(|i| DbcSignal::field(&format!("byte_{i}"), i, 8)).collect()
        }
        _ => Vec::new(),
    }
}

/// Returns the signals of an input, output or parameter buffer. Each value of the buffer offset selects three words of the frame.
fn multiplexed(signals: &[NamedSignal], kind: &str) -> Vec<DbcSignal> {
    let offset = DbcSignal { multiplex: " M".into(), ..DbcSignal::field("offset", 0, 16) };
    let mut fields = vec![offset];
    let mut names = Names::without(&["offset"]);
    for (i, named) in signals.iter().enumerate().take(1 << 16) {
        fields.push(DbcSignal {
            name: names.name(&named.name, &format!("{kind}_{i}")),
            byte: 2 + 2 * (i % 3),
            bit: 0,
            bits: 16,
            signed: named.signal.signed(),
            multiplex: format!(" m{}", i - i % 3),
            signal: Some(named.signal.clone()),
        });
    }
    fields
}

fn message(text: &mut String, function: Function, number: Sequence, signals: Vec<DbcSignal>, endian: Endian) {
    // If a board has no signals of this kind, it never sends this message, so the message needs no multiplexer.
    let signals = if signals.len() == 1 && signals[0].multiplex == " M" { Vec::new() } else { signals };
    let length = match function {
        Function::Ci | Function::So | Function::Par | Function::DspCi => 8,
        _ => signals.iter().map(|s| s.byte + s.bits.div_ceil(8)).max().unwrap_or(0),
    };
    let report = (16..20).contains(&function.number());
    let board = match number {
        Sequence::ZERO => "UCOM".into(),
        _ if report => "UCOM".into(),
        n => format!("UCOM{n}"),
    };
    let (sender, receiver) = match function.sender() {
        Sender::Board => (board.as_str(), "PC"),
        // If both sides can send a function, the DBC file names the board as the sender. A frame with board number 0
        // is a broadcast, which the PC sends.
        Sender::Both if number != Sequence::ZERO => (board.as_str(), "PC"),
        _ => ("PC", board.as_str()),
    };
    let _ = writeln!(text, "BO_ {} {}_{number}: {length} {sender}", function.id(number), function.name());
    signals.iter().for_each(|s| text.push_str(&s.line(endian, receiver)));
    text.push('\n');
}

fn comment(comments: &mut String, function: Function, number: Sequence, more: &str) {
    let sentence = match function {
        Function::DspInfo | Function::DumpIo => " Packages of strings follow under the same identifier.",
        Function::Debug => " Packages of strings: the first counts those that follow.",
        _ => "",
    };
    let gap = if more.is_empty() { "" } else { "; " };
    let end = if more.is_empty() { "" } else { "." };
    let doc = function.doc().replace('"', "'");
    let _ = writeln!(comments, "CM_ BO_ {} \"{doc}{gap}{more}{end}{sentence}\";", function.id(number));
}
