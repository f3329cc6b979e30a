//! Arm model for display: the frames, limits and masses of the arm. The agent uses one answer of the controller for all
//! clients.
use agent_kit::api::Refusals;
use axum::Json;
use axum::extract::State;
use jtc_host::Arm;
use jtc_wire::Joint;
use utoipa::ToSchema;

use super::Agent;
use super::arm::in_words;
use super::identity::Identity;

/// Source of an arm model.
#[derive(Clone, Copy, Debug, serde::Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum ModelSource {
    /// Arm in use by the controller.
    Controller,
    /// Arm of the agent, because the controller cannot return its own arm or has not answered yet.
    Agent,
}

/// Arm in use.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct ModelObject {
    /// Name of the arm.
    pub name: String,
    /// Hash of all parameters that determine how the arm moves; missing if the agent's arm lacks one of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hash: Option<String>,
    /// Source of the arm.
    pub source: ModelSource,
    /// Acceleration of gravity in the frame of the base, m/s².
    #[schema(min_items = 3, max_items = 3)]
    pub gravity_m_s2: [f64; 3],
    /// Joints, from the base. Each rotates about the z axis of its frame.
    #[schema(min_items = 6, max_items = 6)]
    pub joints: Vec<ModelJoint>,
    /// Frame of the flange, fixed in the frame of joint 6.
    pub flange: FrameObject,
    /// Links: the base, then for each joint the link that it moves. Values are in the frame of that joint.
    #[schema(min_items = 7, max_items = 7)]
    pub links: Vec<ModelLink>,
}

/// Frame and limits of a joint.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct ModelJoint {
    /// Number of the joint, 1 to 6 from the base.
    pub joint: u8,
    /// Name of the joint.
    pub name: String,
    /// Origin of its frame at position 0, in the frame of the joint before it: x, y, z, m.
    #[schema(min_items = 3, max_items = 3)]
    pub origin_xyz_m: [f64; 3],
    /// Orientation of its frame at position 0, in the frame of the joint before it: roll, pitch, yaw about fixed axes, as
    /// in a URDF, rad.
    #[schema(min_items = 3, max_items = 3)]
    pub origin_rpy_rad: [f64; 3],
    /// Lowest position, rad.
    pub position_min_rad: f64,
    /// Highest position, rad.
    pub position_max_rad: f64,
    /// Highest speed, rad/s.
    pub velocity_max_rad_s: f64,
    /// Highest acceleration, rad/s².
    pub acceleration_max_rad_s2: f64,
    /// Highest torque, N·m.
    pub torque_max_nm: f64,
}

/// Position and orientation of a frame.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct FrameObject {
    /// Origin x, y, z, m.
    #[schema(min_items = 3, max_items = 3)]
    pub origin_xyz_m: [f64; 3],
    /// Roll, pitch, yaw, rad.
    #[schema(min_items = 3, max_items = 3)]
    pub origin_rpy_rad: [f64; 3],
}

/// Link of the arm.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct ModelLink {
    /// Name of the link.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    #[schema(min_items = 3, max_items = 3)]
    pub com_xyz_m: [f64; 3],
}

impl From<&Identity> for ModelObject {
    fn from(identity: &Identity) -> Self {
        let arm: &Arm = &identity.arm;
        // The controller may have another name for the same arm.
        let (source, name) = match identity.of_controller() {
            Some(info) => (ModelSource::Controller, info.arm.to_string()),
            None => (ModelSource::Agent, arm.name.clone()),
        };
        let joint = |joint: Joint| {
            let (j, limits) = (joint.index(), &arm.joints[joint.index()]);
            let frame = arm.model.joints[j];
            ModelJoint {
                joint: joint.number(),
                name: arm.joint_names[j].clone(),
                origin_xyz_m: frame.xyz,
                origin_rpy_rad: frame.rpy,
                position_min_rad: limits.position_min,
                position_max_rad: limits.position_max,
                velocity_max_rad_s: limits.velocity_max,
                acceleration_max_rad_s2: limits.acceleration_max,
                torque_max_nm: limits.torque_max,
            }
        };
        let links = arm.link_names.iter().zip(&arm.model.links).map(|(name, link)| ModelLink {
            name: name.clone(),
            mass_kg: link.mass,
            com_xyz_m: link.origin.xyz,
        });
        let [.., flange] = arm.model.joints;
        Self {
            name,
            hash: arm.hash().ok().flatten().map(in_words),
            source,
            gravity_m_s2: arm.config().gravity,
            joints: Joint::ALL.into_iter().map(joint).collect(),
            flange: FrameObject { origin_xyz_m: flange.xyz, origin_rpy_rad: flange.rpy },
            links: links.collect(),
        }
    }
}

/// Returns frames, limits and masses of the arm in use.
///
/// The agent reads them from the controller again when the arm may have changed, or when the last answer is older than
/// 10 s.
#[utoipa::path(
    get,
    path = "/api/arm/model",
    operation_id = "get_arm_model",
    responses((status = 200, description = "Arm of the controller, or of the agent if the controller has not reported its arm", body = ModelObject), Refusals)
)]
pub(super) async fn model(State(agent): State<Agent>) -> Json<ModelObject> {
    Json(ModelObject::from(&agent.identity().await))
}
