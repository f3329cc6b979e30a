// Body of the arm, drawn only from the kinematic chain, without meshes: housings about the joint axes, and links
// between the housings.
import {
  BufferGeometry, CapsuleGeometry, CylinderGeometry, Group, LatheGeometry, type Material, Matrix4, Mesh, Quaternion, SphereGeometry, TorusGeometry, Vector2,
  Vector3,
} from 'three';

import { type ArmModel, type Frame, frameOf } from './kinematics.ts';

export interface Materials {
  housing: Material;
  link: Material;
  ring: (joint: number) => Material;
  metal: Material;
  /** Material of the covers at the ends of the housings. */
  cap: Material;
}

export function matrix(frame: Frame): Matrix4 {
  return new Matrix4().set(...(frame as Parameters<Matrix4['set']>));
}

/** Returns the radius of a joint's housing, m. Gears for a higher torque are larger. */
export function housingRadius(torque_nm: number): number {
  return 0.0122 * Math.cbrt(Math.max(torque_nm, 8));
}

/** Returns a cylinder with rounded edges along z, from `low` to `high`. */
function rounded(radius: number, low: number, high: number): BufferGeometry {
  const edge = Math.min(radius * 0.28, (high - low) / 2);
  const profile = [new Vector2(0, low)];
  for (let i = 0; i <= 5; i += 1) {
    const a = (i / 5) * (Math.PI / 2);
    profile.push(new Vector2(radius - edge + edge * Math.sin(a), low + edge - edge * Math.cos(a)));
  }
  for (let i = 0; i <= 5; i += 1) {
    const a = (i / 5) * (Math.PI / 2);
    profile.push(new Vector2(radius - edge + edge * Math.cos(a), high - edge + edge * Math.sin(a)));
  }
  profile.push(new Vector2(0, high));
  return new LatheGeometry(profile, 40).rotateX(Math.PI / 2);
}

/** Returns a tube with round ends from one point to another. The radius of the tube changes from `radius` to `thin`. */
function tube(from: Vector3, to: Vector3, radius: number, thin: number, material: Material): Group {
  const group = new Group();
  const way = to.clone().sub(from);
  const length = way.length();
  const ball = (at: Vector3, r: number) => {
    const mesh = new Mesh(new SphereGeometry(r, 24, 16), material);
    mesh.position.copy(at);
    group.add(mesh);
  };
  ball(from, radius);
  ball(to, thin);
  if (length > 1e-4) {
    const same = Math.abs(radius - thin) < 1e-6;
    const geometry = same ? new CapsuleGeometry(radius, length, 8, 28) : new CylinderGeometry(thin, radius, length, 36, 1, true);
    const mesh = new Mesh(geometry, material);
    mesh.position.copy(from).addScaledVector(way, 0.5);
    mesh.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), way.normalize()));
    group.add(mesh);
  }
  return group;
}

/** All parts that move with the joints, as nested groups. Each joint group is rotated about z. */
export interface Body {
  root: Group;
  /** Groups that are rotated about z by the positions of their joints. */
  joints: Group[];
  /** Frame of each joint before the rotation of the joint. The scene draws the limits in this frame. */
  mounts: Group[];
  flange: Group;
}

/** Returns the body of an arm. `plain`: without rings and plates, for ghosts. */
export function bodyOf(model: ArmModel, materials: Materials, plain = false): Body {
  const root = new Group();
  const [joints, mounts]: [Group[], Group[]] = [[], []];
  const radii = model.joints.map((joint) => housingRadius(joint.torque_max_nm));
  let parent = root;
  const first = model.joints[0];
  if (first && !plain) {
    const r = (radii[0] ?? 0.05) * 1.55;
    root.add(new Mesh(rounded(r, 0, 0.018), materials.metal));
    const height = first.origin_xyz_m[2];
    if (height > 0.02) root.add(new Mesh(rounded((radii[0] ?? 0.05) * 1.08, 0.01, height), materials.housing));
  }
  model.joints.forEach((joint, i) => {
    const mount = new Group();
    mount.applyMatrix4(matrix(frameOf(joint.origin_xyz_m, joint.origin_rpy_rad)));
    parent.add(mount);
    const turned = new Group();
    mount.add(turned);
    joints.push(turned);
    mounts.push(mount);
    const next = model.joints[i + 1];
    const to = new Vector3(...(next ? next.origin_xyz_m : model.flange.origin_xyz_m));
    const radius = radii[i] ?? 0.04;
    const thin = radii[i + 1] ?? radius * 0.8;
    const aside = asideOf(model, i, to);
    // The housing extends from the origin of the joint to the plane of the link.
    const [low, high] = [Math.min(0, aside) - radius * 0.85, Math.max(0, aside) + radius * 0.85];
    turned.add(new Mesh(rounded(radius, low, high), materials.housing));
    if (!plain) {
      for (const [end, way] of [[high, 1], [low, -1]] as const) {
        const cover = new Mesh(rounded(radius * 0.74, -0.004, 0.004), materials.cap);
        cover.position.z = end + way * 0.0005;
        turned.add(cover);
      }
      const ring = new Mesh(new TorusGeometry(radius * 0.985, radius * 0.12, 12, 56), materials.ring(i));
      ring.position.z = aside >= 0 ? low + radius * 0.5 : high - radius * 0.5;
      ring.name = 'ring';
      turned.add(ring);
    }
    linkOf(turned, to, aside, radius, thin, materials.link);
    parent = turned;
  });
  const flange = new Group();
  flange.applyMatrix4(matrix(frameOf(model.flange.origin_xyz_m, model.flange.origin_rpy_rad)));
  parent.add(flange);
  const plate = new Mesh(rounded((radii.at(-1) ?? 0.04) * 0.8, -0.012, 0.004), materials.metal);
  flange.add(plate);
  root.traverse((object) => {
    if (object instanceof Mesh && !plain) {
      object.castShadow = true;
      object.receiveShadow = true;
    }
  });
  return { root, joints, mounts, flange };
}

/**
 * Returns the offset of a link from the origin of its joint along the axis, m. For a link between parallel axes, this
 * is the offset of its centre of mass.
 */
function asideOf(model: ArmModel, i: number, to: Vector3): number {
  const across = Math.hypot(to.x, to.y);
  const com = model.links[i + 1]?.com_xyz_m ?? [0, 0, 0];
  return across > 0.2 ? com[2] : 0;
}

function linkOf(parent: Group, to: Vector3, aside: number, radius: number, thin: number, material: Material): void {
  const across = Math.hypot(to.x, to.y);
  if (to.length() < 0.02) return;
  if (across > 0.2) {
    // For two parallel axes, the link is a straight tube in the plane of the masses, with a housing at its far end.
    const [from, end] = [new Vector3(0, 0, aside), new Vector3(to.x, to.y, aside)];
    parent.add(tube(from, end, radius * 0.8, Math.max(thin * 0.86, radius * 0.62), material));
    const back = new Mesh(rounded(thin * 0.96, Math.min(aside, to.z) - thin * 0.78, Math.max(aside, to.z) + thin * 0.78), material);
    back.position.set(to.x, to.y, 0);
    parent.add(back);
  } else {
    // The link is an elbow: its first part is along the axis, its second part across the axis.
    const r = Math.min(radius, thin) * 0.9;
    const knee = new Vector3(0, 0, to.z);
    if (Math.abs(to.z) > 0.01) parent.add(tube(new Vector3(0, 0, 0), knee, radius * 0.86, r, material));
    if (across > 0.01) parent.add(tube(knee, to, r, r, material));
  }
}
