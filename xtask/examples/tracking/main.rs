//! Runs the control law of the existing firmware and the control law of this project along the same paths on the same
//! simulated plant. The program writes the results to docs/tracking.md.
mod existing;
mod page;
mod paths;
mod run;

use jtc_bus::JOINTS;
use jtc_core::{Config, Parameters};
use jtc_sim::{FrictionModel, LuGre, ModelError, SimConfig};

use run::{Figures, Outcome, Path, Result};

/// Number of random simulated arms. Each result is the median over these arms.
const SEEDS: u64 = 10;

/// Condition under which the program compares both controllers.
#[derive(Clone, Copy, Debug)]
pub struct Condition {
    /// Heading of the condition on the page.
    pub name: &'static str,
    /// Description of the condition on the page.
    pub what: &'static str,
    /// Share of the commanded torque that the drives deliver.
    delivers: f64,
    /// Torque gain of our controller (J-61).
    gain: f64,
    friction: FrictionModel,
    /// Speed around zero within which our friction compensation changes its sign, rad/s (a controller setting).
    sign_width: f64,
    /// Relative errors of the masses and of the friction in the model that both controllers use.
    error: ModelError,
    /// Mass at the flange that is missing in the models of both controllers, kg.
    mass: f64,
    /// Probability that a frame on the joint bus is lost.
    lost: f64,
    jitter_ms: u8,
    /// `true` if the page compares the result with the goal.
    pub judged: bool,
}

impl Condition {
    const IDEAL: Self = Self {
        name: "ideal drives",
        what: "The drives deliver the requested torque. The existing law requests 1.3 times the computed torque.",
        delivers: 1.0,
        gain: 1.0,
        friction: FrictionModel::Smooth { width: 0.01 },
        sign_width: 0.02,
        error: ModelError { mass: 0.1, friction: 0.2, mass_factors: None, friction_factors: None },
        mass: 0.0,
        lost: 0.0,
        jitter_ms: 0,
        judged: true,
    };

    const ALL: [Self; 8] = [
        Self::IDEAL,
        Self {
            name: "drives deliver 1/1.3",
            what: "The drives deliver 1/1.3 of the requested torque, as real drives seem to do. Our controller has a torque gain of 1.3 (J-61).",
            delivers: 1.0 / 1.3,
            gain: 1.3,
            ..Self::IDEAL
        },
        Self {
            name: "sharper friction",
            what: "The friction of the arm changes its sign within 0.005 rad/s instead of 0.01.",
            friction: FrictionModel::Smooth { width: 0.005 },
            ..Self::IDEAL
        },
        Self {
            name: "LuGre friction",
            what: "The joints have static friction of 1.4 times the Coulomb torque, and slip along a Stribeck curve.",
            friction: FrictionModel::LuGre(LuGre {
                stiction_ratio: 1.4,
                stribeck_speed: 0.01,
                presliding: 1e-4,
                damping_ratio: 0.7,
            }),
            judged: false,
            ..Self::IDEAL
        },
        Self {
            name: "2 kg unknown at the flange",
            what: "Both controllers lack this load in their models.",
            mass: 2.0,
            judged: false,
            ..Self::IDEAL
        },
        Self {
            name: "1 % of receptions lost",
            what: "While the arm moves, each receiver loses 1 % of the Moves or answers, independently of the others.",
            lost: 0.01,
            judged: false,
            ..Self::IDEAL
        },
        Self {
            name: "answers 0 or 1 ms late",
            what: "Each millisecond has a new random delay; answers stay in order.",
            jitter_ms: 1,
            judged: false,
            ..Self::IDEAL
        },
        Self {
            name: "answers 0 to 3 ms late",
            what: "Each millisecond has a new random delay; answers stay in order.",
            jitter_ms: 3,
            judged: false,
            ..Self::IDEAL
        },
    ];

    /// Returns the same condition with these relative errors of the masses and the friction in the model.
    fn believing(self, mass: f64, friction: f64) -> Self {
        Self { error: ModelError { mass, friction, ..self.error }, ..self }
    }

    /// Returns the simulation for a random seed. The arm hangs from the ceiling, as in the existing firmware. `gain` is
    /// the torque gain of our controller.
    fn world(&self, seed: u64, start: [f64; JOINTS], gain: f64) -> SimConfig {
        let mut controller = Config { gravity: [0.0, 0.0, 9.81], ..Config::avena() };
        controller.friction_sign_width = self.sign_width;
        controller.joints.iter_mut().for_each(|joint| joint.torque_gain = gain);
        let mut world = SimConfig::new(controller, &Parameters::avena());
        (world.seed, world.start, world.baud) = (seed, start, None);
        (world.model_error, world.arm.friction_model) = (self.error, self.friction);
        world.answer_jitter_ms = self.jitter_ms;
        for drive in &mut world.drives {
            (drive.delivers, drive.first_enable_ms) = (self.delivers, 20);
        }
        let flange = world.arm.model.joints[6].xyz;
        let link = &mut world.arm.model.links[6];
        let total = link.mass + self.mass;
        for (x, f) in link.origin.xyz.iter_mut().zip(flange) {
            *x = (link.mass * *x + self.mass * f) / total;
        }
        link.mass = total;
        world
    }

    /// Returns the results of the existing control law and of our control law. Each result is the median over the random
    /// seeds for which the arm reached the end of the path.
    pub fn compare(&self, path: &Path) -> Result<[Runs; 2]> {
        let start = path.points.first().map(jtc_wire::RawPoint::position_rad).ok_or("an empty path")?;
        let (mut existing, mut ours) = (Vec::new(), Vec::new());
        for seed in 1..=SEEDS {
            existing.push(run::existing(&self.world(seed, start, 1.0), self.lost, path)?);
            ours.push(run::ours(self.world(seed, start, self.gain), self.lost, path)?);
        }
        Ok([Runs::of(&existing), Runs::of(&ours)])
    }
}

/// Results of the runs of one controller.
#[derive(Clone, Debug)]
pub struct Runs {
    /// Number of runs that reached the end of the path.
    pub finished: usize,
    /// Medians over the runs that reached the end of the path; `None` without such a run.
    pub figures: Option<Figures>,
    /// Reasons why runs ended before the end of the path.
    pub errors: Vec<String>,
}

impl Runs {
    fn of(all: &[Outcome]) -> Self {
        let finished: Vec<Figures> =
            all.iter().filter_map(|outcome| outcome.as_ref().ok().copied()).collect();
        let mut errors: Vec<String> =
            all.iter().filter_map(|outcome| outcome.as_ref().err().cloned()).collect();
        errors.sort();
        errors.dedup();
        let figures = (!finished.is_empty()).then(|| median(&finished));
        Self { finished: finished.len(), figures, errors }
    }
}

fn median(all: &[Figures]) -> Figures {
    let of = |figure: fn(&Figures) -> &[f64; JOINTS]| {
        core::array::from_fn(|j| {
            let mut values: Vec<f64> = all.iter().map(|figures| figure(figures)[j]).collect();
            values.sort_by(f64::total_cmp);
            let n = values.len();
            0.5 * (values[(n - 1) / 2] + values[n / 2])
        })
    };
    Figures {
        true_error: of(|figures| &figures.true_error),
        own_error: of(|figures| &figures.own_error),
        roughness: of(|figures| &figures.roughness),
    }
}

/// Returns the errors of our controller with better and better models of the arm: masses and friction wrong, only
/// masses wrong, only friction wrong, and both correct. In the last variant, the width of the friction sign also
/// equals the width in the arm. Each entry contains a heading, and the error of each joint in mrad.
fn bounds(path: &Path, condition: &Condition) -> Result<Vec<(&'static str, [f64; JOINTS])>> {
    let sharp = match condition.friction {
        FrictionModel::Smooth { width } => width,
        FrictionModel::LuGre(_) => condition.sign_width,
    };
    let variants = [
        ("as above", condition.believing(0.1, 0.2)),
        ("correct friction", condition.believing(0.1, 0.0)),
        ("correct masses", condition.believing(0.0, 0.2)),
        ("both correct", condition.believing(0.0, 0.0)),
        (
            "both correct, same width of the friction sign",
            Condition { sign_width: sharp, ..condition.believing(0.0, 0.0) },
        ),
    ];
    let mut rows = Vec::new();
    for (name, variant) in variants {
        let [_, ours] = variant.compare(path)?;
        rows.push((name, ours.figures.ok_or("no run got to its end")?.true_error));
    }
    Ok(rows)
}

fn main() -> Result<()> {
    let file = std::env::args().nth(1).ok_or("usage: tracking FILE")?;
    let mut comparisons = Vec::new();
    for path in paths::all()? {
        for condition in Condition::ALL {
            let [existing, ours] = condition.compare(&path)?;
            let mut comparison =
                page::Comparison { path: path.name, condition, existing, ours, bounds: Vec::new() };
            if !comparison.missed().is_empty() {
                comparison.bounds = bounds(&path, &condition)?;
            }
            println!("{}, {}: {}", path.name, condition.name, comparison.verdict());
            comparisons.push(comparison);
        }
    }
    std::fs::write(&file, page::text(&comparisons))?;
    println!("wrote {file}");
    Ok(())
}
