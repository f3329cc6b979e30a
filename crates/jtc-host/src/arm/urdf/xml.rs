//! Reader of the XML of a robot description.
//!
//! The reader keeps only the elements that the importer uses. It ignores all other elements with their attributes and
//! their text: meshes, materials, extensions of simulators. An error in an ignored element does not matter, if the
//! tags of the file are complete.

use std::collections::BTreeSet;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::robot::{Element, Joint, Kind, Link, Part, Robot};
use crate::file::{FileError, Foreign, Place, short};

/// Maximum nesting depth of elements. Descriptions of arms have a lower depth.
const DEPTH_MAX: usize = 32;
/// Maximum number of joints, and of links. Descriptions of humanoids with hands have about 100.
const PARTS_MAX: usize = 1000;

/// Elements that the importer uses in a joint and in an `inertial` element.
const OF_JOINT: [&str; 8] =
    ["origin", "parent", "child", "axis", "limit", "mimic", "dynamics", "safety_controller"];
const OF_INERTIAL: [&str; 3] = ["origin", "mass", "inertia"];
/// Elements without prefix with which old xacro files add parts to a robot.
const OLD_XACRO: [&str; 4] = ["include", "macro", "property", "insert_block"];

/// Element that is open at a position of the text.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Open {
    Robot,
    Link,
    Inertial,
    Joint,
    Other,
}

/// Reads the links and joints of a robot description.
pub(super) fn read(text: &str) -> Result<Robot, FileError> {
    let mut description = Description { text: text.trim_start_matches('\u{feff}'), ..Description::default() };
    description.read()?;
    Robot::new(description.name, description.joints, description.links)
}

#[derive(Default)]
struct Description<'a> {
    text: &'a str,
    name: String,
    joints: Vec<Joint>,
    links: Vec<Link>,
    /// Open elements, outermost first, each with its line and its name.
    open: Vec<(Open, usize, String)>,
    /// Joint or link that is being read.
    part: Option<(Part, String)>,
    kind: String,
    inertials: Vec<usize>,
    /// Prefixes of the namespace of xacro.
    xacro: BTreeSet<String>,
    /// Root element that is not `robot`.
    other_root: Option<(usize, String)>,
    has_root: bool,
}

impl Description<'_> {
    fn read(&mut self) -> Result<(), FileError> {
        let mut reader = Reader::from_str(self.text);
        // Text is ignored, so a `&` in the text does not matter.
        reader.config_mut().allow_dangling_amp = true;
        let (mut line, mut counted) = (1, 0);
        loop {
            let at = usize::try_from(reader.buffer_position()).unwrap_or(0).min(self.text.len());
            line += self.text.as_bytes()[counted..at].iter().filter(|byte| **byte == b'\n').count();
            counted = at;
            let event = reader.read_event().map_err(|e| {
                let at = usize::try_from(reader.error_position()).unwrap_or(0).min(self.text.len());
                let line = line
                    + self.text.as_bytes()[counted..at.max(counted)]
                        .iter()
                        .filter(|byte| **byte == b'\n')
                        .count();
                self.wrong(line, e.to_string())
            })?;
            match event {
                Event::Start(tag) => self.begin(&tag, line)?,
                Event::Empty(tag) => {
                    self.begin(&tag, line)?;
                    self.end()?;
                }
                Event::End(_) => self.end()?,
                Event::DocType(text) if contains(&text, b"<!ENTITY") => {
                    return Err(
                        self.wrong(line, "the file declares XML entities: replace them by their text")
                    );
                }
                Event::Eof => break,
                _ => {}
            }
        }
        match (self.open.last(), self.has_root, self.other_root.take()) {
            (Some((_, line, name)), ..) => {
                let problem = format!("the file is incomplete: <{}> is not closed", short(name));
                Err(self.wrong(*line, problem))
            }
            (None, false, _) => {
                Err(FileError::form("not a valid URDF: the file is incomplete or has no element"))
            }
            (None, true, Some((line, name))) => {
                let problem = format!("the root element is <{}>, expected <robot> of a URDF", short(&name));
                Err(FileError::at(Place::line(line), problem))
            }
            (None, true, None) => Ok(()),
        }
    }

    /// Returns an error at a line, with the name of the open joint or link.
    fn wrong(&self, line: usize, problem: impl Into<String>) -> FileError {
        let place = Place::line(line);
        match &self.part {
            Some((part, _)) => FileError::at(place.named(part.title.clone()), problem),
            None => FileError::at(place, problem),
        }
    }

    fn begin(&mut self, tag: &BytesStart, line: usize) -> Result<(), FileError> {
        let name = String::from_utf8_lossy(tag.name().as_ref()).into_owned();
        if name.contains('<') {
            let inner = name.split('<').next().unwrap_or_default();
            return Err(self.wrong(line, format!("the tag <{} has no >", short(inner))));
        }
        let parent = self.open.last().map(|(open, ..)| *open);
        if self.open.len() >= DEPTH_MAX {
            return Err(FileError::at(
                Place::line(line),
                format!("XML nested more than {DEPTH_MAX} levels deep is not a description of an arm"),
            ));
        }
        self.find_xacro(tag, &name, parent, line)?;
        let open = match (parent, name.as_str()) {
            (None, _) => self.root(tag, &name, line)?,
            (Some(Open::Robot), "link" | "joint") => self.begin_part(tag, &name, line)?,
            (Some(Open::Link), "inertial") => {
                self.inertials.push(line);
                Open::Inertial
            }
            (Some(Open::Joint), name) if OF_JOINT.contains(&name) => self.element(tag, name, line)?,
            (Some(Open::Inertial), name) if OF_INERTIAL.contains(&name) => self.element(tag, name, line)?,
            _ => Open::Other,
        };
        self.open.push((open, line, name));
        Ok(())
    }

    /// Finds elements that the program xacro replaces. An arm from such a file would lack the parts that xacro adds.
    fn find_xacro(
        &mut self,
        tag: &BytesStart,
        name: &str,
        parent: Option<Open>,
        line: usize,
    ) -> Result<(), FileError> {
        let raw = tag.attributes_raw();
        if contains(raw, b"xmlns") && contains(raw, b"xacro") {
            for attribute in tag.attributes().with_checks(false).flatten() {
                let key = String::from_utf8_lossy(attribute.key.as_ref()).into_owned();
                if let Some(prefix) = key.strip_prefix("xmlns:")
                    && contains(&attribute.value, b"xacro")
                {
                    self.xacro.insert(prefix.to_owned());
                }
            }
        }
        let prefixed =
            name.split_once(':').is_some_and(|(prefix, _)| prefix == "xacro" || self.xacro.contains(prefix));
        let old = parent == Some(Open::Robot)
            && OLD_XACRO.contains(&name)
            && (!self.xacro.is_empty() || contains(raw, b"${") || contains(raw, b"$("));
        if prefixed || old {
            return Err(foreign(Foreign::Xacro, line, format!("<{}>", short(name))));
        }
        Ok(())
    }

    fn root(&mut self, tag: &BytesStart, name: &str, line: usize) -> Result<Open, FileError> {
        if self.has_root {
            return Err(FileError::at(Place::line(line), "the file has a second root element: remove it"));
        }
        self.has_root = true;
        match name {
            "robot" => {
                let attributes = self.attributes(tag, line)?;
                self.name = attributes
                    .into_iter()
                    .find(|(key, _)| key == "name")
                    .map_or_else(String::new, |(_, v)| v);
                Ok(Open::Robot)
            }
            "mujoco" | "mujocoinclude" => Err(foreign(Foreign::Mjcf, line, format!("<{name}>"))),
            "sdf" | "gazebo" => Err(foreign(Foreign::Sdf, line, format!("<{name}>"))),
            _ => {
                self.other_root = Some((line, name.to_owned()));
                Ok(Open::Other)
            }
        }
    }

    fn begin_part(&mut self, tag: &BytesStart, kind: &str, line: usize) -> Result<Open, FileError> {
        if self.joints.len().max(self.links.len()) >= PARTS_MAX {
            return Err(FileError::at(
                Place::line(line),
                format!("more than {PARTS_MAX} joints or links are not a description of an arm"),
            ));
        }
        let attributes = self.attributes(tag, line)?;
        let get = |key: &str| attributes.iter().find(|(name, _)| name == key).map(|(_, value)| value.clone());
        let Some(name) = get("name").filter(|name| !name.is_empty()) else {
            return Err(FileError::at(Place::line(line), format!("<{kind}> has no name")));
        };
        self.kind = get("type").unwrap_or_default();
        self.inertials.clear();
        let title = format!("{kind} {}", name.replace(char::is_control, " "));
        self.part = Some((Part { title, line, elements: Vec::new() }, name));
        Ok(if kind == "joint" { Open::Joint } else { Open::Link })
    }

    fn element(&mut self, tag: &BytesStart, name: &str, line: usize) -> Result<Open, FileError> {
        let attributes = self.attributes(tag, line)?;
        if let Some((part, _)) = &mut self.part {
            part.elements.push(Element { name: name.to_owned(), line, attributes });
        }
        Ok(Open::Other)
    }

    /// Returns the attributes of an element, without those that have a prefix.
    fn attributes(&self, tag: &BytesStart, line: usize) -> Result<Vec<(String, String)>, FileError> {
        let mut all = Vec::new();
        let name = String::from_utf8_lossy(tag.name().as_ref()).into_owned();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|e| self.wrong(line, format!("<{}>: {e}", short(&name))))?;
            let key = String::from_utf8_lossy(attribute.key.as_ref()).into_owned();
            if key.contains(':') {
                continue;
            }
            let value = attribute
                .unescape_value()
                .map_err(|e| self.wrong(line, format!("<{}> {}: {e}", short(&name), short(&key))))?;
            if value.contains("${") || value.contains("$(") {
                return Err(foreign(
                    Foreign::Xacro,
                    line,
                    format!("<{name} {}=\"{}\">", short(&key), short(&value)),
                ));
            }
            all.push((key, value.into_owned()));
        }
        Ok(all)
    }

    fn end(&mut self) -> Result<(), FileError> {
        let Some((open @ (Open::Joint | Open::Link), ..)) = self.open.pop() else { return Ok(()) };
        let Some((part, name)) = self.part.take() else { return Ok(()) };
        if open == Open::Link {
            self.links.push(Link { name, part, inertials: std::mem::take(&mut self.inertials) });
            return Ok(());
        }
        let kind = Kind::named(&self.kind).ok_or_else(|| {
            let known = "revolute, continuous, prismatic, fixed, floating or planar";
            part.wrong(part.line, format!("type \"{}\" is not known, expected {known}", short(&self.kind)))
        })?;
        let [parent, child] = ["parent", "child"].map(|of| ended(&part, of));
        self.joints.push(Joint { name, kind, parent: parent?, child: child?, part });
        Ok(())
    }
}

/// Returns the link at one end of a joint.
fn ended(part: &Part, end: &str) -> Result<String, FileError> {
    let element = part.only(end)?.ok_or_else(|| part.wrong(part.line, format!("has no element <{end}>")))?;
    let link = element.text("link").map(str::to_owned);
    link.ok_or_else(|| part.wrong(element.line, format!("<{end}> has no attribute link")))
}

fn foreign(form: Foreign, line: usize, element: String) -> FileError {
    FileError::Foreign { path: std::path::PathBuf::new(), place: Place::line(line), element, form }
}

fn contains(text: &[u8], part: &[u8]) -> bool {
    text.windows(part.len()).any(|window| window.eq_ignore_ascii_case(part))
}
