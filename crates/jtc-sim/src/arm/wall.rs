//! Walls that the arm can touch. A wall is a plane that the flange touches, or an angle that limits one joint.
use jtc_bus::Joint;
use jtc_dynamics::{Dynamics, JOINTS, JointVec};

use super::{Arm, SimArm};

/// Distance to a wall below which the simulation includes the wall when it chooses the number of sub-steps, m or rad.
const NEAR: f64 = 0.01;

/// Side of an angle on which the wall is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The wall is at angles greater than its limit angle.
    Above,
    /// The wall is at angles less than its limit angle.
    Below,
}

impl core::fmt::Display for Side {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(if *self == Self::Above { "above" } else { "below" })
    }
}

/// A flat or angular obstacle. A wall can push but not pull. The force is stiffness times depth plus damping times
/// the inward speed, and never negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wall {
    /// A plane that limits the position of the flange's origin.
    Plane {
        /// Point of the wall's surface in the base frame, m.
        position: [f64; 3],
        /// Direction out of the wall, as a vector in the base frame. The length of this normal vector must not be 0.
        normal: [f64; 3],
        /// Stiffness, N/m.
        stiffness: f64,
        /// Damping, N·s/m.
        damping: f64,
    },
    /// An angle at which a joint is stopped.
    Joint {
        /// Joint that the wall stops.
        joint: Joint,
        /// Angle at which the wall begins, rad.
        angle: f64,
        /// Side of the angle on which the wall is.
        side: Side,
        /// Stiffness, N·m/rad.
        stiffness: f64,
        /// Damping, N·m·s/rad.
        damping: f64,
    },
}

/// Surface of a wall.
#[derive(Clone, Debug)]
enum Surface {
    Plane {
        normal: [f64; 3],
        /// Position of the surface along the normal, m.
        offset: f64,
        /// Dynamics with a gravity of 1 m/s² into the wall. With these dynamics, the simulation computes the joint
        /// torques of a force on the flange along the normal.
        pulled: Box<Dynamics>,
    },
    Joint {
        index: usize,
        /// Direction of the push: 1 towards greater angles, −1 towards smaller angles.
        sign: f64,
        angle: f64,
    },
}

/// A wall with its state.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    wall: Wall,
    surface: Surface,
    stiffness: f64,
    damping: f64,
    /// Distance that the current surface is inside the configured surface, m or rad. This distance is above 0 while a
    /// wall that was created inside the arm has not reached its configured position.
    recess: f64,
}

/// Depth of the arm in a wall, and the joint torques that a unit force of the wall causes.
struct Touch {
    depth: f64,
    torques: JointVec,
}

impl Touch {
    /// Returns the speed of the arm out of the wall, m/s or rad/s.
    fn speed(&self, qd: &JointVec) -> f64 {
        self.torques.iter().zip(qd).map(|(g, v)| g * v).sum()
    }
}

impl Contact {
    /// Creates the state of a wall. `dynamics` computes the flange of the arm at `q`. If the configured wall would
    /// overlap the arm, its surface begins at the arm instead. The surface moves to its configured position when the
    /// arm moves away. A new wall therefore cannot push the arm away suddenly.
    pub(super) fn new(wall: Wall, parts: &SimArm, dynamics: &Dynamics, q: &JointVec) -> Self {
        let (surface, stiffness, damping) = match wall {
            Wall::Plane { position, normal, stiffness, damping } => {
                let length = dot(&normal, &normal).sqrt();
                let normal = normal.map(|x| x / length);
                let pulled = Box::new(Dynamics::new(&parts.model, normal.map(|x| -x)));
                let offset = dot(&normal, &position);
                (Surface::Plane { normal, offset, pulled }, stiffness, damping)
            }
            Wall::Joint { joint, angle, side, stiffness, damping } => {
                let sign = if side == Side::Above { -1.0 } else { 1.0 };
                (Surface::Joint { index: joint.index(), sign, angle }, stiffness, damping)
            }
        };
        let mut contact = Self { wall, surface, stiffness, damping, recess: 0.0 };
        contact.recess = contact.touch(dynamics, q).depth.max(0.0);
        contact
    }

    pub(super) fn wall(&self) -> &Wall {
        &self.wall
    }

    fn touch(&self, dynamics: &Dynamics, q: &JointVec) -> Touch {
        let (depth, torques) = match &self.surface {
            Surface::Plane { normal, offset, pulled } => {
                let flange = dynamics.forward_kinematics(q)[JOINTS].position;
                (offset - dot(normal, &flange), pulled.flange_torque(q))
            }
            Surface::Joint { index, sign, angle } => {
                let mut torques = [0.0; JOINTS];
                torques[*index] = *sign;
                (sign * (angle - q[*index]), torques)
            }
        };
        Touch { depth: depth - self.recess, torques }
    }

    /// Adds to `sum` the joint torques (N·m) that the force of the wall causes. `damped` is the share of the damping
    /// that is applied.
    pub(super) fn push(
        &self,
        dynamics: &Dynamics,
        q: &JointVec,
        qd: &JointVec,
        damped: f64,
        sum: &mut JointVec,
    ) {
        let touch = self.touch(dynamics, q);
        if touch.depth > 0.0 {
            let force = self.stiffness * touch.depth - damped * self.damping * touch.speed(qd);
            if force > 0.0 {
                sum.iter_mut().zip(touch.torques).for_each(|(sum, g)| *sum += g * force);
            }
        }
    }

    /// Returns the contribution of the wall to the squared highest natural frequency of the arm (1/s²), and to its
    /// fastest decay rate (1/s). Both are 0 if the arm cannot touch the wall within `dt`. `mobility` returns the
    /// joint accelerations that joint torques cause.
    pub(super) fn rates(
        &self,
        dynamics: &Dynamics,
        q: &JointVec,
        qd: &JointVec,
        dt: f64,
        mobility: impl Fn(&JointVec) -> JointVec,
    ) -> (f64, f64) {
        let touch = self.touch(dynamics, q);
        let reach = (-2.0 * dt * touch.speed(qd)).max(0.0) + NEAR;
        if touch.depth + reach <= 0.0 {
            return (0.0, 0.0);
        }
        let inverse_mass = touch.speed(&mobility(&touch.torques));
        (self.stiffness * inverse_mass, self.damping * inverse_mass)
    }

    /// Moves the surface of a wall with the arm, if the surface is not at its configured position.
    pub(super) fn follow(&mut self, dynamics: &Dynamics, q: &JointVec) {
        if self.recess > 0.0 {
            self.recess = (self.recess + self.touch(dynamics, q).depth).clamp(0.0, self.recess);
        }
    }
}

impl Arm {
    /// Adds to `sum` the joint torques (N·m) that the forces of all walls cause at `q` and `qd`.
    pub(super) fn push_of_walls(&self, q: &JointVec, qd: &JointVec, damped: f64, sum: &mut JointVec) {
        for contact in &self.contacts {
            contact.push(&self.dynamics, q, qd, damped, sum);
        }
    }

    /// Returns the torques of the walls on the joints, N·m.
    pub fn wall_torque(&self) -> JointVec {
        let mut sum = [0.0; JOINTS];
        self.push_of_walls(&self.q, &self.qd, 1.0, &mut sum);
        sum
    }

    /// Sets the walls. Walls that already exist keep their state. Walls that are not in the list `walls` are removed.
    pub fn set_walls(&mut self, walls: &[Wall]) {
        let mut known = core::mem::take(&mut self.contacts);
        for &wall in walls {
            let contact = match known.iter().position(|contact| *contact.wall() == wall) {
                Some(place) => known.swap_remove(place),
                None => Contact::new(wall, &self.parts, &self.dynamics, &self.q),
            };
            self.contacts.push(contact);
        }
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
