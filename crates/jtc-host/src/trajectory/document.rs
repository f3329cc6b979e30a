//! JSON and YAML documents as values, and the messages for text that is neither.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor};

use crate::file::{FileError, Place, short};

/// Value of a JSON or YAML document. Numbers can be NaN and infinite.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Node {
    Null,
    Flag,
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

impl Node {
    /// Returns the value of a key.
    pub(crate) fn get(&self, key: &str) -> Option<&Node> {
        let Node::Map(entries) = self else { return None };
        entries.iter().find(|(name, _)| name == key).map(|(_, value)| value)
    }

    /// Returns the items of a list. A missing or empty value is an empty list.
    pub(crate) fn list(&self) -> Option<&[Node]> {
        match self {
            Node::List(items) => Some(items),
            Node::Null => Some(&[]),
            _ => None,
        }
    }

    /// Returns the number. YAML files can have quotation marks around a number.
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Node::Number(value) => Some(*value),
            Node::Text(text) => text.trim().parse().ok(),
            _ => None,
        }
    }

    /// Returns a short description for a message.
    pub(crate) fn words(&self) -> String {
        match self {
            Node::Null => "nothing".into(),
            Node::Flag => "true or false".into(),
            Node::Number(value) => value.to_string(),
            Node::Text(text) => format!("\"{}\"", short(text)),
            Node::List(items) => format!("a list of {}", items.len()),
            Node::Map(_) => "an object".into(),
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Values)
    }
}

struct Values;

impl<'de> Visitor<'de> for Values {
    type Value = Node;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_bool<E>(self, _: bool) -> Result<Node, E> {
        Ok(Node::Flag)
    }

    fn visit_i64<E>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_i128<E>(self, value: i128) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_u128<E>(self, value: u128) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Number(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Node, E> {
        Ok(Node::Text(value.to_owned()))
    }

    fn visit_bytes<E>(self, _: &[u8]) -> Result<Node, E> {
        Ok(Node::Text("bytes".to_owned()))
    }

    fn visit_unit<E>(self) -> Result<Node, E> {
        Ok(Node::Null)
    }

    fn visit_none<E>(self) -> Result<Node, E> {
        Ok(Node::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Node, D::Error> {
        Node::deserialize(deserializer)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Node, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Node::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Node, A::Error> {
        let mut entries: Vec<(String, Node)> = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            // The files of interest have few keys per object. Many keys would make this check slow.
            if entries.len() < 64 && entries.iter().any(|(before, _)| *before == key) {
                return Err(A::Error::custom(format!("duplicate field `{}`", short(&key))));
            }
            entries.push((key, map.next_value()?));
        }
        Ok(Node::Map(entries))
    }
}

/// Reads all JSON values of a text. Most files contain one value. Files with JSON lines contain one value per line.
pub(super) fn json(text: &str) -> Result<Vec<Node>, FileError> {
    let values = serde_json::Deserializer::from_str(text).into_iter::<Node>();
    values.collect::<Result<Vec<_>, _>>().map_err(|e| json_error(&e, text))
}

/// Returns the error for a text that is not valid JSON, or whose values are not as expected.
pub(crate) fn json_error(error: &serde_json::Error, text: &str) -> FileError {
    let place = Place { line: Some(error.line()), column: Some(error.column()), name: None };
    let words = error.to_string();
    let words = words.rsplit_once(" at line ").map_or(words.as_str(), |(words, _)| words);
    let line = text.split('\n').nth(error.line().saturating_sub(1)).unwrap_or_default();
    let near = |from: usize| line.get(from..).unwrap_or_default().trim_start_matches(['-', '+']);
    let not_finite = || {
        // The column is the number of the last byte that was read.
        let starts = (error.column().saturating_sub(2)..=error.column()).map(near);
        ["nan", "infinity", "inf"].into_iter().find(|word| {
            starts
                .clone()
                .any(|rest| rest.get(..word.len()).is_some_and(|head| head.eq_ignore_ascii_case(word)))
        })
    };
    let problem = match error.classify() {
        serde_json::error::Category::Data => data_words(words),
        serde_json::error::Category::Eof => "the text ends before the last value is complete".to_owned(),
        _ => match not_finite() {
            Some("nan") => return FileError::at(place, "NaN is not a finite number"),
            Some(_) => return FileError::at(place, "inf is not a finite number"),
            None => syntax_words(words).to_owned(),
        },
    };
    FileError::at(place, format!("JSON: {problem}"))
}

fn syntax_words(words: &str) -> &'static str {
    let table = [
        ("trailing comma", "a comma without a value after the comma"),
        ("trailing characters", "more text after the end of the value"),
        ("recursion limit", "lists and objects are nested too deeply"),
        ("key must be a string", "a key without quotation marks"),
        ("expected `:`", "a key without a colon after the key"),
        ("expected `,`", "two values without a comma between them"),
        ("control character", "a control character in a text"),
        ("invalid escape", "an invalid escape sequence in a text"),
        ("lone leading surrogate", "an invalid escape sequence in a text"),
        ("invalid unicode", "an invalid character in a text"),
        ("number out of range", "a number that is too large"),
        ("invalid number", "an invalid number"),
    ];
    table.iter().find(|(start, _)| words.contains(start)).map_or("not a valid value", |(_, own)| own)
}

/// Returns the message for a value of a wrong type, or for a wrong key.
fn data_words(words: &str) -> String {
    let quoted = |text: &str| text.trim_matches('`').to_owned();
    if let Some((found, expected)) =
        words.strip_prefix("invalid type: ").and_then(|w| w.split_once(", expected "))
    {
        return format!("invalid type: {}, expected {}", short(&found_words(found)), type_words(expected));
    }
    if let Some((count, _)) = words.strip_prefix("invalid length ").and_then(|w| w.split_once(',')) {
        return format!("{count} values, expected 6");
    }
    if let Some((key, _)) = words.strip_prefix("unknown field ").and_then(|w| w.split_once(", expected ")) {
        return format!("unknown key {}", short(&quoted(key)));
    }
    if let Some(key) = words.strip_prefix("missing field ") {
        return format!("the key {} is missing", short(&quoted(key)));
    }
    if let Some(key) = words.strip_prefix("duplicate field ") {
        return format!("the key {} occurs twice", short(&quoted(key)));
    }
    if words.starts_with("invalid value") || words.starts_with("trailing characters") {
        return "a value is out of range".to_owned();
    }
    words.chars().filter(|c| !c.is_control()).collect()
}

fn found_words(found: &str) -> String {
    let (kind, value) = found.split_once(' ').unwrap_or((found, ""));
    let value = value.trim_start_matches("point ").trim_matches('`');
    match kind {
        "sequence" => "a list".to_owned(),
        "map" => "an object".to_owned(),
        "null" | "unit" => "nothing".to_owned(),
        "boolean" => value.to_owned(),
        "floating" | "integer" => format!("the number {value}"),
        "string" => format!("the text {value}"),
        _ => "a value of another kind".to_owned(),
    }
}

fn type_words(expected: &str) -> &str {
    match expected {
        "f64" => "a number",
        "u16" => "a whole number",
        "a string" => "a text",
        "a sequence" => "a list",
        "a map" => "an object",
        word if word.starts_with("an array") => "a list of 6 numbers",
        word if word.starts_with("struct") => "an object",
        word => word,
    }
}

/// Reads a YAML document.
pub(super) fn yaml(text: &str) -> Result<Node, FileError> {
    let count = yaml_documents(text);
    if count > 1 {
        return Err(FileError::form(format!(
            "{count} messages in the file (lines of --- separate the messages), expected one; `ros2 topic echo --once` writes one message"
        )));
    }
    // The reader must accept more YAML nodes than by default, because a trajectory of 12,000 points has about 300,000
    // nodes.
    let options = serde_saphyr::options! {
        budget: serde_saphyr::budget! { max_nodes: 2_000_000, max_events: 4_000_000 },
        with_snippet: false,
    };
    // `ros2 topic echo` writes a line of dashes after each message.
    let content = text.trim_end().trim_end_matches("---");
    serde_saphyr::from_str_with_options::<Node>(content, options).map_err(|e| yaml_error(&e, text))
}

/// Returns the number of documents that contain text.
fn yaml_documents(text: &str) -> usize {
    let mut documents = 0;
    let mut empty = true;
    for line in text.lines() {
        if line == "---" || line.starts_with("--- ") {
            empty = true;
        } else if empty && !line.trim().is_empty() && !line.starts_with(['#', '%']) && line.trim() != "..." {
            empty = false;
            documents += 1;
        }
    }
    documents
}

fn yaml_error(error: &serde_saphyr::Error, text: &str) -> FileError {
    let found =
        error.location().map(|l| (l.line() as usize, l.column() as usize)).filter(|(line, _)| *line > 0);
    let line = found.map(|(line, _)| line);
    let place = Place { line, column: found.map(|(_, column)| column), name: None };
    let shown = line.and_then(|line| text.lines().nth(line - 1)).map_or("", str::trim);
    let words = error.to_string().to_lowercase();
    let problem = if words.contains("duplicate") {
        "a key occurs twice in an object".to_owned()
    } else if words.contains("budget") {
        "more values than a trajectory can have".to_owned()
    } else if words.contains("alias") || words.contains("anchor") {
        "anchors and aliases are not supported".to_owned()
    } else if words.contains("tab") && text.contains('\t') {
        "tabs are not valid as indentation".to_owned()
    } else if shown.is_empty() {
        "not a valid document".to_owned()
    } else {
        format!("\"{}\" is not valid here", short(shown))
    };
    FileError::at(place, format!("YAML: {problem}"))
}
