//! Model of a simulated board's application: some axes, controlled by the words of CI, SO and PAR.
use super::axis::{Axis, AxisConfig, Command};

/// Controller inputs of an axis, with name, unit and initial value.
const INPUTS: [(&str, &str, i16); 3] =
    [("set_position", "0.01 deg", 0), ("stiffness", "0.1 %", 1000), ("speed_limit", "0.1 deg/s", 900)];
/// Sensor outputs of an axis, with name and unit.
const OUTPUTS: [(&str, &str); 5] = [
    ("position", "0.01 deg"),
    ("velocity", "0.1 deg/s"),
    ("current", "mA"),
    ("temperature", "0.1 C"),
    ("reference", "0.01 deg"),
];
/// Parameters of an axis, with name, unit and default. For the position limits, the defaults are the mechanical stops of the axis.
const PARAMETERS: [(&str, &str, i16); 5] = [
    ("kp", "mA/deg", 120),
    ("kd", "0.1 mA s/deg", 80),
    ("min_position", "0.01 deg", i16::MIN),
    ("max_position", "0.01 deg", i16::MAX),
    ("current_max", "mA", 2000),
];

/// Axes of a board, and their words.
#[derive(Clone, Debug)]
pub(super) struct Model {
    axes: Vec<Axis>,
    ci_names: Vec<String>,
    so_names: Vec<String>,
    par_names: Vec<String>,
    initial_ci: Vec<u16>,
    initial_par: Vec<u16>,
    /// `true` for each axis whose set point is beyond its limits. Such a set point is reported only once.
    limited: Vec<bool>,
}

impl Model {
    pub(crate) fn new(axes: &[AxisConfig]) -> Self {
        let axes: Vec<Axis> = axes.iter().map(Axis::new).collect();
        let names = |words: &[(&str, &str)]| -> Vec<String> {
            let of = |axis: &Axis, (name, unit): &(&str, &str)| match axis.config().name.as_str() {
                "" => format!("{name} [{unit}]"),
                axis => format!("{axis}_{name} [{unit}]"),
            };
            axes.iter().flat_map(|axis| words.iter().map(move |word| of(axis, word))).collect()
        };
        let heads = |words: &[(&'static str, &'static str, i16)]| -> Vec<(&'static str, &'static str)> {
            words.iter().map(|(name, unit, _)| (*name, *unit)).collect()
        };
        let (ci_names, par_names) = (names(&heads(&INPUTS)), names(&heads(&PARAMETERS)));
        let so_names = names(&OUTPUTS);
        let mut initial_ci = Vec::new();
        let mut initial_par = Vec::new();
        for axis in &axes {
            let c = axis.config();
            let [_, stiffness, speed] = INPUTS.map(|(_, _, value)| value as u16);
            initial_ci.extend([word(c.start_deg * 100.0), stiffness, speed]);
            let [kp, kd, _, _, current] = PARAMETERS.map(|(_, _, value)| value as u16);
            initial_par.extend([kp, kd, word(c.min_deg * 100.0), word(c.max_deg * 100.0), current]);
        }
        let limited = axes.iter().map(|_| false).collect();
        Self { axes, ci_names, so_names, par_names, initial_ci, initial_par, limited }
    }

    pub(crate) fn ci_names(&self) -> &[String] {
        &self.ci_names
    }

    pub(crate) fn so_names(&self) -> &[String] {
        &self.so_names
    }

    pub(crate) fn par_names(&self) -> &[String] {
        &self.par_names
    }

    pub(crate) fn initial_ci(&self) -> &[u16] {
        &self.initial_ci
    }

    pub(crate) fn initial_par(&self) -> &[u16] {
        &self.initial_par
    }

    /// Advances the simulation of the axes by `seconds`; the outputs of the board are enabled if `active`. The function returns a text to
    /// report, or `None`.
    pub(crate) fn advance(&mut self, seconds: f64, active: bool, ci: &[u16], par: &[u16]) -> Option<String> {
        let mut reported = None;
        for (i, axis) in self.axes.iter_mut().enumerate() {
            let (Some(ci), Some(par)) = (triple(ci, 3 * i), five(par, 5 * i)) else { continue };
            let command = command(ci, par);
            axis.advance(seconds, active.then_some(&command));
            let beyond = active && !(command.limits.0..=command.limits.1).contains(&command.set_position);
            if beyond && !self.limited[i] {
                let name = if axis.config().name.is_empty() { "axis" } else { &axis.config().name };
                reported =
                    Some(format!("{name}: set point {:.2} deg is outside its limits", command.set_position));
            }
            self.limited[i] = beyond;
        }
        reported
    }

    /// Returns the sensor outputs in the order of their names.
    pub(crate) fn outputs(&self) -> impl Iterator<Item = u16> {
        self.axes.iter().flat_map(|a| {
            [
                word(a.position * 100.0),
                word(a.velocity * 10.0),
                word(a.current),
                word(a.temperature * 10.0),
                word(a.reference * 100.0),
            ]
        })
    }
}

/// Returns a value as a 16-bit word in two's complement. A value that is out of range results in the nearest word.
fn word(value: f64) -> u16 {
    value.round() as i16 as u16
}

fn triple(words: &[u16], at: usize) -> Option<[u16; 3]> {
    words.get(at..at + 3)?.try_into().ok()
}

fn five(words: &[u16], at: usize) -> Option<[u16; 5]> {
    words.get(at..at + 5)?.try_into().ok()
}

fn command([position, stiffness, speed]: [u16; 3], [kp, kd, min, max, current]: [u16; 5]) -> Command {
    let signed = |w: u16| f64::from(w as i16);
    Command {
        set_position: signed(position) / 100.0,
        stiffness: (signed(stiffness) / 1000.0).clamp(0.0, 1.0),
        speed_limit: (signed(speed) / 10.0).max(0.0),
        kp: signed(kp).max(0.0),
        kd: signed(kd).max(0.0) / 10.0,
        limits: (signed(min) / 100.0, signed(max) / 100.0),
        current_max: signed(current).max(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_move_the_right_axis() {
        let axis = |name: &str| AxisConfig { name: name.into(), ..Default::default() };
        let mut model = Model::new(&[axis("left"), axis("right")]);
        assert_eq!(model.ci_names()[3], "right_set_position [0.01 deg]");
        assert_eq!((model.ci_names().len(), model.so_names().len(), model.par_names().len()), (6, 10, 10));
        assert_eq!((model.initial_ci().len(), model.initial_par().len()), (6, 10));
        let (mut ci, par) = (model.initial_ci().to_vec(), model.initial_par().to_vec());
        ci[3] = (-1500_i16) as u16;
        assert_eq!(model.advance(1.0, true, &ci, &par), None);
        let so: Vec<i16> = model.outputs().map(|w| w as i16).collect();
        assert!((so[5] + 1500).abs() < 60 && so[0].abs() < 60, "{so:?}");
        // A set point beyond its limit is reported once, not in every cycle.
        ci[3] = 9000;
        assert!(model.advance(0.01, true, &ci, &par).unwrap().contains("90.00 deg"));
        assert_eq!(model.advance(0.01, true, &ci, &par), None);
    }

    #[test]
    fn safe_outputs_mean_no_current_whatever_the_words_are() {
        let mut model = Model::new(&[AxisConfig::default()]);
        let par = model.initial_par().to_vec();
        model.advance(0.1, true, &[3000, 1000, 900], &par);
        assert_ne!(model.outputs().nth(2), Some(0));
        model.advance(0.001, false, &[3000, 1000, 900], &par);
        assert_eq!(model.outputs().nth(2), Some(0));
    }
}
