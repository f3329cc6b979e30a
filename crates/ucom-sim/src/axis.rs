//! Motor axis that a board's application moves in a simulated chain.
use serde::Deserialize;

/// Step of the numerical integration, s. The step is short compared with the time constants of the position control,
/// even with the largest gains that the words of the protocol can represent.
const STEP_S: f64 = 0.000_5;
/// Speed below which friction stops the axis, °/s.
const STANDS_DEG_S: f64 = 0.5;
/// Ambient temperature, °C.
pub(super) const AMBIENT_C: f64 = 24.0;
/// Temperature above which the axis limits its current, °C.
const HOT_C: f64 = 80.0;

/// Mechanical properties of an axis.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AxisConfig {
    /// Prefix of the names of the inputs and outputs of the axis; empty on a board with one axis.
    pub name: String,
    /// Position of the lower mechanical stop, degrees.
    pub min_deg: f64,
    /// Position of the upper mechanical stop, degrees.
    pub max_deg: f64,
    /// Position of the axis at power-up, degrees.
    pub start_deg: f64,
    /// Acceleration of the axis by the motor current, °/s² per mA.
    pub acceleration_per_ma: f64,
    /// Coefficient of viscous friction, 1/s.
    pub damping_per_s: f64,
    /// Deceleration by dry friction, °/s².
    pub friction_deg_s2: f64,
    /// Acceleration by gravity at 90°, in °/s²; negative if gravity moves the axis to the upright position.
    pub gravity_deg_s2: f64,
}

impl Default for AxisConfig {
    fn default() -> Self {
        Self {
            name: String::new(),
            min_deg: -60.0,
            max_deg: 60.0,
            start_deg: 0.0,
            acceleration_per_ma: 4.0,
            damping_per_s: 6.0,
            friction_deg_s2: 60.0,
            gravity_deg_s2: 0.0,
        }
    }
}

/// Command to the position controller of an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Command {
    /// Set position, degrees.
    pub set_position: f64,
    /// Share of the largest current that the controller may use, 0 to 1.
    pub stiffness: f64,
    /// Speed limit of the axis, °/s.
    pub speed_limit: f64,
    /// Proportional gain of the controller, mA/°.
    pub kp: f64,
    /// Derivative gain of the controller, mA·s/°.
    pub kd: f64,
    /// Lower and upper limit of the set position, degrees.
    pub limits: (f64, f64),
    /// Largest motor current, mA.
    pub current_max: f64,
}

/// State of a simulated axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    config: AxisConfig,
    /// Position of the axis, degrees.
    pub position: f64,
    /// Velocity of the axis, °/s.
    pub velocity: f64,
    /// Motor current, mA.
    pub current: f64,
    /// Temperature of the motor, °C.
    pub temperature: f64,
    /// Set point of the position controller, degrees. The set point moves towards the set position, at most at the
    /// speed limit.
    pub reference: f64,
}

impl Axis {
    pub(crate) fn new(config: &AxisConfig) -> Self {
        Self {
            config: config.clone(),
            position: config.start_deg,
            velocity: 0.0,
            current: 0.0,
            temperature: AMBIENT_C,
            reference: config.start_deg,
        }
    }

    pub(crate) fn config(&self) -> &AxisConfig {
        &self.config
    }

    /// Advances the simulation of the axis. Without a command the outputs are safe: the current is 0, and the set point follows the axis.
    pub(crate) fn advance(&mut self, seconds: f64, command: Option<&Command>) {
        let mut rest = seconds;
        while rest > 0.0 {
            let step = rest.min(STEP_S);
            self.step(step, command);
            rest -= step;
        }
    }

    fn step(&mut self, dt: f64, command: Option<&Command>) {
        self.current = command.map_or(0.0, |c| self.control(dt, c));
        if command.is_none() {
            self.reference = self.position;
        }
        let c = &self.config;
        let gravity = c.gravity_deg_s2 * self.position.to_radians().sin();
        let push = c.acceleration_per_ma * self.current + gravity;
        if self.velocity.abs() < STANDS_DEG_S && push.abs() <= c.friction_deg_s2 {
            self.velocity = 0.0;
        } else {
            let way = if self.velocity.abs() < STANDS_DEG_S { push } else { self.velocity };
            // The simulation integrates the damping implicitly, so the integration is stable for every step.
            let free = self.velocity + dt * (push - c.friction_deg_s2 * way.signum());
            self.velocity = free / (1.0 + dt * c.damping_per_s);
        }
        self.position += dt * self.velocity;
        if self.position <= c.min_deg || self.position >= c.max_deg {
            self.position = self.position.clamp(c.min_deg, c.max_deg);
            self.velocity = 0.0;
        }
        // With a current of 2 A, the temperature rises to about 60 K above ambient, with a time constant of 40 s.
        let heat = 15.0 * (self.current / 1000.0).powi(2);
        self.temperature += dt * (heat - (self.temperature - AMBIENT_C)) / 40.0;
    }

    /// Returns the motor current that the position controller commands. The set point of the controller moves at most at the speed limit.
    fn control(&mut self, dt: f64, c: &Command) -> f64 {
        let goal = c.set_position.max(c.limits.0).min(c.limits.1);
        let way = (goal - self.reference).clamp(-c.speed_limit * dt, c.speed_limit * dt);
        self.reference += way;
        let current = c.kp * (self.reference - self.position) + c.kd * (way / dt - self.velocity);
        let hot = if self.temperature > HOT_C { 0.3 } else { 1.0 };
        let most = c.current_max * c.stiffness * hot;
        current.clamp(-most, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMAND: Command = Command {
        set_position: 20.0,
        stiffness: 1.0,
        speed_limit: 90.0,
        kp: 120.0,
        kd: 8.0,
        limits: (-50.0, 50.0),
        current_max: 2000.0,
    };

    #[test]
    fn it_goes_where_it_is_commanded_at_the_speed_it_is_allowed() {
        let mut axis = Axis::new(&AxisConfig { gravity_deg_s2: 900.0, ..Default::default() });
        axis.advance(0.1, Some(&COMMAND));
        assert!(axis.position > 4.0 && axis.position < 10.0, "{}", axis.position);
        axis.advance(2.0, Some(&COMMAND));
        assert!((axis.position - 20.0).abs() < 1.0, "{}", axis.position);
        assert!(axis.velocity.abs() < 0.1, "{}", axis.velocity);
        // A set position beyond the limit moves the axis to the limit.
        axis.advance(5.0, Some(&Command { set_position: 300.0, ..COMMAND }));
        assert!((axis.position - 50.0).abs() < 2.0, "{}", axis.position);
    }

    #[test]
    fn without_a_command_no_current_flows() {
        let mut axis = Axis::new(&AxisConfig::default());
        axis.advance(1.0, Some(&COMMAND));
        axis.advance(0.001, None);
        assert_eq!(axis.current, 0.0);
        axis.advance(1.0, None);
        assert_eq!((axis.velocity, axis.reference), (0.0, axis.position));
    }

    /// Extreme gains within the range of the protocol's words never cause values that are not finite.
    #[test]
    fn wild_gains_stay_finite_and_within_the_stops() {
        let mut axis = Axis::new(&AxisConfig { gravity_deg_s2: 5000.0, ..Default::default() });
        let wild =
            Command { kp: 32767.0, kd: 32767.0, current_max: 32767.0, speed_limit: 32767.0, ..COMMAND };
        for i in 0..200 {
            let set_position = if i % 2 == 0 { 327.0 } else { -327.0 };
            axis.advance(0.01, Some(&Command { set_position, ..wild }));
            assert!((-60.0..=60.0).contains(&axis.position) && axis.velocity.is_finite());
            assert!(axis.temperature.is_finite());
        }
    }
}
