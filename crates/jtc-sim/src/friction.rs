//! Friction of the simulated joints as a function of speed and temperature, including the friction around standstill.
//!
//! In motion, both friction models follow one measured curve (polynomial or table). The models differ around zero speed.
//! [`FrictionModel::LuGre`] sticks, breaks away and slips like real gears. In [`FrictionModel::Smooth`] friction changes its sign over
//! a small range of speed, so the model can neither stick nor hunt.
//!
//! Above the measured speeds, the curve continues as a straight line that does not decrease. An extrapolated cubic polynomial would
//! drive the joint (c3 < 0), or become too steep for the integration steps.
use jtc_core::TableOf;
use jtc_dynamics::{JOINTS, JointVec};

/// Highest natural frequency of a rotor on its friction bristles that the integration with steps of 1 ms represents
/// accurately, rad/s.
const STIFFEST: f64 = 800.0;
/// Smallest friction level that the code uses as a divisor, N·m.
const LEAST_LEVEL: f64 = 1e-9;

/// True friction of a joint as a function of speed, without the effects around standstill.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
pub enum SimFriction {
    /// The joint has no friction.
    Frictionless,
    /// The friction torque is (1 + c4·(T − c5))·(c0·s + c1·v + c2·v²·s + c3·v³) with s = sign(v), up to
    /// [`SimArm::polynomial_speed`](crate::SimArm).
    Polynomial([f64; 6]),
    /// The friction torque is interpolated in a measured table.
    Table(TableOf<f32>),
}

/// Friction around standstill.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrictionModel {
    /// Model without stiction, in which the sign of the velocity is v/√(v² + width²). If the width is below 0.005 rad/s, the
    /// Runge-Kutta method with steps of 1 ms is unstable.
    Smooth {
        /// Speed around zero within which friction changes its sign, rad/s.
        width: f64,
    },
    /// Bristle model with stiction, presliding and Stribeck curve.
    LuGre(LuGre),
}

impl Default for FrictionModel {
    fn default() -> Self {
        Self::LuGre(LuGre::default())
    }
}

/// The LuGre friction model (Canudas de Wit, Olsson, Åström, Lischinsky 1995). The surfaces touch through bristles of
/// mean deflection z (rad), with
///
/// - dz/dt = v − σ0·|v|/g(v)·z,
/// - friction torque = σ0·z + σ1(v)·dz/dt + viscous part,
/// - g(v) = Coulomb level·(1 + (`stiction_ratio` − 1)/(1 + (v/`stribeck_speed`)²)).
///
/// The Coulomb level (c0) and the viscous part (c1..c3) are taken from the curve of the joint. The Stribeck curve has
/// the rational form of Hess and Soom (1990). σ1 decreases with speed like the Stribeck curve, so that the model
/// remains dissipative (Olsson 1996, section 3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGre {
    /// Break-away torque divided by Coulomb torque. The example in the paper uses 1.5. Values of harmonic drives are
    /// between 1.1 and 1.6.
    pub stiction_ratio: f64,
    /// Speed at which half of the excess of stiction over Coulomb friction remains, rad/s.
    pub stribeck_speed: f64,
    /// Deflection at which the bristles carry the Coulomb torque, rad. The stiffness is σ0 = Coulomb torque/deflection. The default is
    /// about one count of the joint encoder. The stiffness of stiffer bristles is reduced until the natural frequency of the rotor on
    /// its bristles is below 800 rad/s.
    pub presliding: f64,
    /// Damping ratio of the rotor on its bristles, with σ1 = 2·ratio·√(σ0·rotor inertia).
    pub damping_ratio: f64,
}

impl Default for LuGre {
    fn default() -> Self {
        Self { stiction_ratio: 1.4, stribeck_speed: 0.01, presliding: 1e-4, damping_ratio: 0.7 }
    }
}

/// Friction of all joints at their current temperatures. Each array has one entry per joint, so that the compiler can
/// process six joints at once.
#[derive(Clone, Debug)]
pub(crate) struct FrictionTorques {
    model: FrictionModel,
    curves: [SimFriction; JOINTS],
    /// Polynomial coefficients, with one row per power. The coefficients are zero for joints with a friction table.
    k: [JointVec; 4],
    /// Speed above which the friction curve continues as a straight line, rad/s. The next field is the slope of this
    /// line, N·m·s/rad. Both are zero for joints with a friction table.
    reach: JointVec,
    slope: JointVec,
    /// Velocities and torques of the joints that have a friction table.
    tables: [Option<Box<Points>>; JOINTS],
    any_table: bool,
    /// Temperature for which `tables` was computed, °C.
    table_temperature: JointVec,
    /// Stiffness σ0 of the bristles, N·m/rad.
    stiffness: JointVec,
    /// Damping σ1 of the bristles at standstill, N·m·s/rad.
    damping: JointVec,
}

impl FrictionTorques {
    /// Creates the friction of all joints. `rotor` is the inertia of the rotors at the joints, kg·m². `reach` is the
    /// speed up to which polynomials are valid, rad/s.
    pub(crate) fn new(
        model: FrictionModel,
        curves: [SimFriction; JOINTS],
        rotor: &JointVec,
        reach: &JointVec,
    ) -> Self {
        let mut new = Self {
            model,
            curves,
            k: [[0.0; JOINTS]; 4],
            reach: reach.map(f64::abs),
            slope: [0.0; JOINTS],
            tables: [const { None }; JOINTS],
            any_table: false,
            table_temperature: [f64::NAN; JOINTS],
            stiffness: [0.0; JOINTS],
            damping: [0.0; JOINTS],
        };
        if let FrictionModel::LuGre(lugre) = model {
            for j in 0..JOINTS {
                let coulomb = match &new.curves[j] {
                    SimFriction::Frictionless => 0.0,
                    SimFriction::Polynomial(c) => c[0].max(0.0),
                    SimFriction::Table(table) => {
                        Points::cut(table, table.temperature[9].into(), 1.0).coulomb()
                    }
                };
                let stiffness = (coulomb / lugre.presliding).min(STIFFEST * STIFFEST * rotor[j]);
                new.stiffness[j] = stiffness;
                new.damping[j] = 2.0 * lugre.damping_ratio * (stiffness * rotor[j]).sqrt();
            }
        }
        new
    }

    /// Updates the friction curves to the bearing temperatures (°C), and multiplies the friction by `scale`.
    pub(crate) fn warm(&mut self, temperature: &JointVec, scale: &JointVec) {
        for j in 0..JOINTS {
            let t = temperature[j];
            match &self.curves[j] {
                SimFriction::Frictionless => {}
                SimFriction::Polynomial(c) => {
                    let k = scale[j] * (1.0 + c[4] * (t - c[5])).clamp(0.2, 2.0);
                    for (row, c) in self.k.iter_mut().zip(c) {
                        row[j] = k * c;
                    }
                    self.slope[j] = self.polynomial_slope(j, self.reach[j]).max(0.0);
                }
                SimFriction::Table(table) => {
                    // The initial temperature is NaN. The comparison is false for NaN, so the first call updates the
                    // tables.
                    if (t - self.table_temperature[j]).abs() < 0.02 {
                        continue;
                    }
                    self.table_temperature[j] = t;
                    let mut points = Points::cut(table, t, scale[j]);
                    if matches!(self.model, FrictionModel::LuGre(_)) {
                        self.k[0][j] = points.take_coulomb();
                    }
                    self.tables[j] = Some(Box::new(points));
                    self.any_table = true;
                }
            }
        }
    }

    /// Makes the next call of [`warm`](Self::warm) update the tables, because a scale has changed.
    pub(crate) fn forget_tables(&mut self) {
        self.table_temperature = [f64::NAN; JOINTS];
    }

    /// Returns the friction torque for velocities `v` (rad/s) and bristle deflections `z` (rad), N·m. The torque acts against the
    /// motion.
    #[inline]
    pub(crate) fn at(&self, v: &JointVec, z: &JointVec) -> JointVec {
        let [k0, k1, k2, k3] = &self.k;
        let viscous = |j: usize| {
            let u = v[j].max(-self.reach[j]).min(self.reach[j]);
            u * (k1[j] + k2[j] * u.abs() + k3[j] * u * u) + self.slope[j] * (v[j] - u)
        };
        let mut out: JointVec = match self.model {
            FrictionModel::Smooth { width } => core::array::from_fn(|j| {
                let v = v[j];
                k0[j] * v / (v * v + width * width).sqrt() + viscous(j)
            }),
            FrictionModel::LuGre(lugre) => {
                let inverse = 1.0 / lugre.stribeck_speed;
                core::array::from_fn(|j| {
                    let (v, load) = (v[j], self.stiffness[j] * z[j]);
                    let (b, level) = lugre.stribeck(v * inverse, k0[j]);
                    // The code computes the term σ1(v)·dz/dt with one denominator, because divisions need most of the time of this
                    // function.
                    let bending = (v * level - v.abs() * load * b) / (b * level);
                    load + self.damping[j] * bending + viscous(j)
                })
            }
        };
        if self.any_table {
            for (j, table) in self.tables.iter().enumerate() {
                if let Some(table) = table {
                    out[j] += table.at(v[j]);
                }
            }
        }
        out
    }

    /// Returns the slope of the friction curve at velocities `v` (rad/s), N·m·s/rad; the result is at least 0. The slope does not
    /// include the effects around standstill, because their slope has a separate limit.
    pub(crate) fn steepness(&self, v: &JointVec) -> JointVec {
        core::array::from_fn(|j| match &self.tables[j] {
            Some(table) => table.slope(v[j]).max(0.0),
            None if v[j].abs() < self.reach[j] => self.polynomial_slope(j, v[j].abs()).max(0.0),
            None => self.slope[j],
        })
    }

    fn polynomial_slope(&self, j: usize, speed: f64) -> f64 {
        let [_, k1, k2, k3] = &self.k;
        k1[j] + speed * (2.0 * k2[j] + 3.0 * k3[j] * speed)
    }

    /// Returns the bristle deflections after `dt` seconds at velocities `v`, from the deflections `z`.
    ///
    /// dz/dt = v − rate·z is too stiff for the Runge-Kutta method with steps of 1 ms, because the rate reaches 10⁴/s at
    /// high speed. For a constant velocity the exact solution is z·e + v·dt·(1 − e)/x with x = rate·dt, e = exp(−x).
    /// With 1/(1 + x + x²/2) instead of e, the method is of second order and needs no exponential function. The method
    /// converges to the exact end value g/σ0 for any x.
    #[inline]
    pub(crate) fn bend(&self, z: &JointVec, v: &JointVec, dt: f64) -> JointVec {
        let FrictionModel::LuGre(lugre) = self.model else { return *z };
        let inverse = 1.0 / lugre.stribeck_speed;
        core::array::from_fn(|j| {
            let v = v[j];
            let (b, level) = lugre.stribeck(v * inverse, self.k[0][j]);
            // `a` is x·level, with x = rate·dt. Numerator and denominator are multiplied by level².
            let a = dt * self.stiffness[j] * v.abs() * b;
            let half = level + 0.5 * a;
            level * (z[j] * level + v * dt * half) / (level * level + a * half)
        })
    }
}

impl LuGre {
    /// Returns b = 1 + r², and b·g(v) in N·m. `coulomb` is the Coulomb torque (N·m), and `r` is the velocity in
    /// multiples of the Stribeck speed. The inverse of b decreases from 1 at standstill to 0 far above the Stribeck
    /// speed.
    #[inline]
    fn stribeck(&self, r: f64, coulomb: f64) -> (f64, f64) {
        let b = 1.0 + r * r;
        (b, coulomb.max(LEAST_LEVEL) * (b + (self.stiction_ratio - 1.0)))
    }
}

/// A friction table at one temperature.
#[derive(Clone, Debug)]
struct Points {
    /// Velocities, rad/s.
    velocity: [f64; 20],
    /// Torques, N·m.
    torque: [f64; 20],
}

impl Points {
    /// Returns the velocities and torques of the table at one temperature (°C). A temperature outside the table is
    /// limited to the range of the table.
    fn cut(table: &TableOf<f32>, temperature: f64, scale: f64) -> Self {
        let axis = table.temperature.map(f64::from);
        let t = temperature.clamp(axis[0], axis[19]);
        let i = axis[1..19].iter().filter(|&&start| t >= start).count();
        let u = (t - axis[i]) / (axis[i + 1] - axis[i]);
        let torque = table.torque.map(|row| {
            let (a, b) = (f64::from(row[i]), f64::from(row[i + 1]));
            scale * (a + u * (b - a))
        });
        Self { velocity: table.velocity.map(f64::from), torque }
    }

    /// Interpolates linearly between the points of the table, and extrapolates with the first and last line segments.
    fn at(&self, v: f64) -> f64 {
        let i = self.segment(v);
        // Above the last point of the table, the line begins at this point.
        let from = i + usize::from(v > self.velocity[19]);
        self.torque[from] + (v - self.velocity[from]) * self.slope(v)
    }

    /// Returns the slope of the line segment at `v`, N·m·s/rad.
    fn slope(&self, v: f64) -> f64 {
        let (x, y, i) = (&self.velocity, &self.torque, self.segment(v));
        let slope = (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
        if v < x[0] || v > x[19] { slope.max(0.0) } else { slope }
    }

    /// Returns the index of the point at which the line segment at `v` begins.
    fn segment(&self, v: f64) -> usize {
        self.velocity[1..19].iter().filter(|&&start| v >= start).count()
    }

    /// Returns the Coulomb torque, N·m. For each direction, a line through the two slowest points gives the torque at
    /// standstill. The Coulomb torque is the mean of these two torques.
    fn coulomb(&self) -> f64 {
        let (x, y) = (&self.velocity, &self.torque);
        let start = |near: usize, far: usize, sign: f64| {
            let slope = (y[far] - y[near]) / (x[far] - x[near]);
            // The Coulomb torque is at most the torque of the slowest point. This limit has an effect if the curve
            // decreases at low speed.
            (sign * (y[near] - slope * x[near])).clamp(0.0, (sign * y[near]).max(0.0))
        };
        let above = x.iter().position(|&v| v > 0.0).filter(|&i| i + 1 < x.len());
        let below = x.iter().rposition(|&v| v < 0.0).filter(|&i| i > 0);
        match (below, above) {
            (Some(b), Some(a)) => 0.5 * (start(b, b - 1, -1.0) + start(a, a + 1, 1.0)),
            _ => 0.0,
        }
    }

    /// Removes the Coulomb torque from the points, and returns the Coulomb torque. The points then contain only the viscous part.
    fn take_coulomb(&mut self) -> f64 {
        let coulomb = self.coulomb();
        for (v, torque) in self.velocity.iter().zip(&mut self.torque) {
            if *v != 0.0 {
                *torque -= coulomb.copysign(*v);
            }
        }
        coulomb
    }
}

#[cfg(test)]
#[path = "friction_tests.rs"]
mod tests;
