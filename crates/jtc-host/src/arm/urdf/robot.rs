//! Parts of a robot description that the importer uses: links with their inertia, and joints.
//!
//! The attributes of an element are parsed when the importer needs them. An error in an element that the importer does
//! not use therefore does not matter.

use std::collections::HashMap;

use jtc_dynamics::{Link as Body, Origin};

use crate::file::{FileError, Place, short};

/// Element with the attributes that the importer may use.
#[derive(Clone, Debug, Default)]
pub(super) struct Element {
    pub name: String,
    pub line: usize,
    pub attributes: Vec<(String, String)>,
}

impl Element {
    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.attributes.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }
}

/// Largest angle that counts as one full turn, rad. Many descriptions round 2π up to this value.
pub(super) const TURN: f64 = 6.3;

/// Link or joint with the elements that it contains.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// Kind and name, such as `joint shoulder`.
    pub title: String,
    pub line: usize,
    pub elements: Vec<Element>,
}

impl Part {
    /// Returns an error about a line of this part.
    pub(super) fn wrong(&self, line: usize, problem: impl Into<String>) -> FileError {
        FileError::at(Place::line(line).named(self.title.clone()), problem)
    }

    /// Returns the element with this name. Returns an error if the part has two such elements, because the importer
    /// cannot know which of them is meant.
    pub(super) fn only(&self, name: &str) -> Result<Option<&Element>, FileError> {
        let mut found = self.elements.iter().filter(|element| element.name == name);
        let first = found.next();
        match (first, found.next()) {
            (Some(first), Some(second)) => Err(self.wrong(
                second.line,
                format!("second element <{name}>, the first is in line {}: remove one of them", first.line),
            )),
            _ => Ok(first),
        }
    }

    /// Returns the numbers of an attribute. Returns `None` if the attribute is missing.
    fn numbers<const N: usize>(&self, of: &Element, key: &str) -> Result<Option<[f64; N]>, FileError> {
        let Some(text) = of.text(key) else { return Ok(None) };
        let wrong = |problem: String| self.wrong(of.line, format!("<{}> {key} {problem}", of.name));
        let words: Vec<&str> = text.split_whitespace().collect();
        let numbers = words.iter().map(|word| word.parse::<f64>()).collect::<Result<Vec<_>, _>>();
        let numbers = match numbers {
            Ok(numbers) if !words.is_empty() => numbers,
            _ if text.contains(',') => {
                return Err(wrong(format!(
                    "is \"{}\", not a number: write decimal points, and spaces between numbers",
                    short(text)
                )));
            }
            _ => return Err(wrong(format!("is \"{}\", not a number", short(text)))),
        };
        let count = numbers.len();
        let all = <[f64; N]>::try_from(numbers);
        all.map(Some).map_err(|_| wrong(format!("has {count} numbers, expected {N}")))
    }

    fn number(&self, of: &Element, key: &str) -> Result<Option<f64>, FileError> {
        Ok(self.numbers::<1>(of, key)?.map(|[number]| number))
    }

    /// Returns the attribute `key` of the element `name`, or `default` if the element or the attribute is missing.
    fn value<const N: usize>(&self, name: &str, key: &str, default: [f64; N]) -> Result<[f64; N], FileError> {
        let Some(element) = self.only(name)? else { return Ok(default) };
        Ok(self.numbers(element, key)?.unwrap_or(default))
    }

    fn origin(&self) -> Result<Origin, FileError> {
        let Some(element) = self.only("origin")? else { return Ok(Origin { xyz: [0.0; 3], rpy: [0.0; 3] }) };
        if element.text("quat_xyzw").is_some() {
            let problem =
                "attribute quat_xyzw of <origin> is not supported: write the rotation as rpy, in rad";
            return Err(self.wrong(element.line, problem));
        }
        let xyz = self.numbers(element, "xyz")?.unwrap_or_default();
        let rpy: [f64; 3] = self.numbers(element, "rpy")?.unwrap_or_default();
        if let Some(angle) = rpy.into_iter().find(|angle| angle.abs() > TURN) {
            let problem = format!(
                "rpy: {angle} rad exceeds one turn; if it is in degrees, {angle}° are {:.6} rad",
                angle.to_radians()
            );
            return Err(self.wrong(element.line, problem));
        }
        Ok(Origin { xyz, rpy })
    }
}

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Revolute,
    Continuous,
    Prismatic,
    Fixed,
    Floating,
    Planar,
}

impl Kind {
    const ALL: [(&'static str, Self); 6] = [
        ("revolute", Self::Revolute),
        ("continuous", Self::Continuous),
        ("prismatic", Self::Prismatic),
        ("fixed", Self::Fixed),
        ("floating", Self::Floating),
        ("planar", Self::Planar),
    ];

    /// Returns the kind with this name in a robot description.
    pub(super) fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(word, _)| *word == name).map(|(_, kind)| *kind)
    }

    pub(super) fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(word, _)| word)
    }

    /// Returns `true` for a joint that turns about an axis.
    pub(super) fn is_rotary(self) -> bool {
        matches!(self, Self::Revolute | Self::Continuous)
    }
}

/// Joint that another joint moves: `position = multiplier · position of the leader + offset`.
#[derive(Clone, Debug)]
pub(super) struct Mimic {
    pub leader: String,
    pub multiplier: f64,
    pub offset: f64,
}

/// Limits of a joint. A number that is missing in the description is 0, except for the two position limits.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limit {
    /// Lower and upper position limit (rad, m); `None` if the description contains neither of them.
    pub range: Option<(f64, f64)>,
    pub effort: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub name: String,
    pub kind: Kind,
    /// Name of the link that carries the joint.
    pub parent: String,
    /// Name of the link that the joint moves.
    pub child: String,
    pub part: Part,
}

impl Joint {
    pub(super) fn origin(&self) -> Result<Origin, FileError> {
        self.part.origin()
    }

    /// Returns the axis of the joint. If the description contains several axes, the first one is used, as other URDF
    /// readers do.
    pub(super) fn axis(&self) -> Result<[f64; 3], FileError> {
        let Some(first) = self.axes().next() else { return Ok([1.0, 0.0, 0.0]) };
        Ok(self.part.numbers(first, "xyz")?.unwrap_or([1.0, 0.0, 0.0]))
    }

    /// Returns the elements with the axes of the joint. A valid description has one at most.
    pub(super) fn axes(&self) -> impl Iterator<Item = &Element> {
        self.part.elements.iter().filter(|element| element.name == "axis")
    }

    /// Returns `true` if the description has an element `mimic` for the joint. A fixed joint does not mimic another.
    pub(super) fn is_mimic(&self) -> bool {
        self.kind != Kind::Fixed && self.part.elements.iter().any(|element| element.name == "mimic")
    }

    pub(super) fn mimic(&self) -> Result<Option<Mimic>, FileError> {
        let Some(element) = self.part.only("mimic")?.filter(|_| self.is_mimic()) else { return Ok(None) };
        let missing = || self.part.wrong(element.line, "<mimic> has no attribute joint");
        let leader = element.text("joint").ok_or_else(missing)?.to_owned();
        let multiplier = self.part.number(element, "multiplier")?.unwrap_or(1.0);
        let offset = self.part.number(element, "offset")?.unwrap_or(0.0);
        Ok(Some(Mimic { leader, multiplier, offset }))
    }

    pub(super) fn limit(&self) -> Result<Limit, FileError> {
        let Some(element) = self.part.only("limit")? else { return Ok(Limit::default()) };
        let number = |key| self.part.number(element, key);
        let range = match (number("lower")?, number("upper")?) {
            (None, None) => None,
            (lower, upper) => Some((lower.unwrap_or(0.0), upper.unwrap_or(0.0))),
        };
        let or_zero = |key| Ok::<f64, FileError>(number(key)?.unwrap_or(0.0));
        Ok(Limit {
            range,
            effort: or_zero("effort")?,
            velocity: or_zero("velocity")?,
            acceleration: or_zero("acceleration")?,
        })
    }

    /// Returns the Coulomb friction (N·m) and the viscous friction (N·m·s/rad). A missing, negative or infinite number
    /// is replaced by 0.
    pub(super) fn friction(&self) -> Result<[f64; 2], FileError> {
        let [coulomb] = self.part.value("dynamics", "friction", [0.0])?;
        let [viscous] = self.part.value("dynamics", "damping", [0.0])?;
        Ok([coulomb, viscous].map(|v| if v > 0.0 && v.is_finite() { v } else { 0.0 }))
    }

    pub(super) fn has_safety_controller(&self) -> bool {
        self.part.elements.iter().any(|element| element.name == "safety_controller")
    }
}

#[derive(Clone, Debug)]
pub(super) struct Link {
    pub name: String,
    /// Link with the elements of its `inertial` element.
    pub part: Part,
    /// Lines of the `inertial` elements. A valid description has one at most.
    pub inertials: Vec<usize>,
}

impl Link {
    /// Returns mass, centre of mass and inertia of the link. A missing number is 0.
    pub(super) fn body(&self) -> Result<Body, FileError> {
        if let [first, second, ..] = self.inertials[..] {
            let problem =
                format!("second element <inertial>, the first is in line {first}: remove one of them");
            return Err(self.part.wrong(second, problem));
        }
        let mass = match self.part.only("mass")? {
            None => 0.0,
            Some(element) => self
                .part
                .number(element, "value")?
                .ok_or_else(|| self.part.wrong(element.line, "<mass> has no attribute value"))?,
        };
        let moment = |key| Ok::<f64, FileError>(self.part.value("inertia", key, [0.0])?[0]);
        let inertia =
            [moment("ixx")?, moment("ixy")?, moment("ixz")?, moment("iyy")?, moment("iyz")?, moment("izz")?];
        Ok(Body { origin: self.part.origin()?, inertia, mass })
    }

    /// Returns `true` if the description contains the moments of inertia of the link about all three axes.
    pub(super) fn has_inertia(&self) -> Result<bool, FileError> {
        let Some(element) = self.part.only("inertia")? else { return Ok(false) };
        for key in ["ixx", "iyy", "izz"] {
            if self.part.number(element, key)?.is_none() {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Links and joints of a robot description.
#[derive(Clone, Debug, Default)]
pub(super) struct Robot {
    pub name: String,
    pub joints: Vec<Joint>,
    pub links: Vec<Link>,
    /// Index of the joint that moves a link, by the name of the link.
    by_child: HashMap<String, usize>,
    by_name: HashMap<String, usize>,
}

impl Robot {
    /// Creates a robot. Returns an error if a name is not unique or a link has two parents. The reader rejects a
    /// duplicate name, because it cannot know which of the two joints or links is meant.
    pub(super) fn new(name: String, joints: Vec<Joint>, links: Vec<Link>) -> Result<Self, FileError> {
        let mut names = HashMap::new();
        for (i, joint) in joints.iter().enumerate() {
            if let Some(first) = names.insert(joint.name.clone(), i) {
                return Err(twice("joint", &joint.name, [&joints[first].part, &joint.part]));
            }
        }
        let mut by_name = HashMap::new();
        for (i, link) in links.iter().enumerate() {
            if let Some(first) = by_name.insert(link.name.clone(), i) {
                return Err(twice("link", &link.name, [&links[first].part, &link.part]));
            }
        }
        let mut by_child = HashMap::new();
        for (i, joint) in joints.iter().enumerate() {
            if let Some(first) = by_child.insert(joint.child.clone(), i) {
                let problem = format!(
                    "link {} is the child of joints {} and {} (lines {} and {}), expected only one parent joint",
                    joint.child, joints[first].name, joint.name, joints[first].part.line, joint.part.line
                );
                return Err(FileError::form(problem));
            }
        }
        Ok(Self { name, joints, links, by_child, by_name })
    }

    /// Returns the joint that moves a link.
    pub(super) fn above(&self, link: &str) -> Option<&Joint> {
        self.by_child.get(link).map(|i| &self.joints[*i])
    }

    pub(super) fn link(&self, name: &str) -> Option<&Link> {
        self.by_name.get(name).map(|i| &self.links[*i])
    }

    pub(super) fn joint(&self, name: &str) -> Option<&Joint> {
        self.joints.iter().find(|joint| joint.name == name)
    }

    /// Returns the joints that a link carries.
    pub(super) fn on<'a>(&'a self, link: &'a str) -> impl Iterator<Item = &'a Joint> {
        self.joints.iter().filter(move |joint| joint.parent == link)
    }
}

fn twice(kind: &str, name: &str, parts: [&Part; 2]) -> FileError {
    let [first, second] = parts.map(|part| part.line);
    FileError::form(format!("two {kind}s are named {name} (lines {first} and {second}): rename one of them"))
}
