// Geometry of the arm: computes frames from joint positions. Frames are defined as in a URDF: origin in the parent
// frame, and rpy about fixed axes. Joints rotate about z.

export interface JointModel {
  joint: number;
  name: string;
  origin_xyz_m: [number, number, number];
  origin_rpy_rad: [number, number, number];
  position_min_rad: number;
  position_max_rad: number;
  velocity_max_rad_s: number;
  acceleration_max_rad_s2: number;
  torque_max_nm: number;
}

export interface LinkModel {
  name: string;
  mass_kg: number;
  com_xyz_m: [number, number, number];
}

export interface ArmModel {
  name: string;
  hash?: string | null;
  source?: string;
  gravity_m_s2: [number, number, number];
  joints: JointModel[];
  flange: { origin_xyz_m: [number, number, number]; origin_rpy_rad: [number, number, number] };
  links: LinkModel[];
}

/** A frame as a 4×4 matrix, row by row. */
export type Frame = number[];
export type Vector = [number, number, number];

export function multiply(a: Frame, b: Frame): Frame {
  const out = new Array<number>(16).fill(0);
  for (let r = 0; r < 4; r += 1) {
    for (let c = 0; c < 4; c += 1) {
      let sum = 0;
      for (let k = 0; k < 4; k += 1) sum += (a[4 * r + k] ?? 0) * (b[4 * k + c] ?? 0);
      out[4 * r + c] = sum;
    }
  }
  return out;
}

/** Returns the frame with the rotation Rz(yaw) · Ry(pitch) · Rx(roll) and the origin xyz. */
export function frameOf(xyz: Vector, [roll, pitch, yaw]: Vector): Frame {
  const [cr, sr, cp, sp, cy, sy] = [
    Math.cos(roll), Math.sin(roll), Math.cos(pitch), Math.sin(pitch), Math.cos(yaw), Math.sin(yaw),
  ];
  return [
    cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0],
    sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1],
    -sp, cp * sr, cp * cr, xyz[2],
    0, 0, 0, 1,
  ];
}

export function turn(q: number): Frame {
  const [c, s] = [Math.cos(q), Math.sin(q)];
  return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
}

export function place(frame: Frame): Vector {
  return [frame[3] ?? 0, frame[7] ?? 0, frame[11] ?? 0];
}

export function transform(frame: Frame, [x, y, z]: Vector): Vector {
  const row = (r: number) => (frame[4 * r] ?? 0) * x + (frame[4 * r + 1] ?? 0) * y + (frame[4 * r + 2] ?? 0) * z + (frame[4 * r + 3] ?? 0);
  return [row(0), row(1), row(2)];
}

/** Returns the frames of the rotated joints and of the flange, in the base frame. */
export function forward(model: ArmModel, q: readonly number[]): Frame[] {
  const frames: Frame[] = [];
  let frame = frameOf([0, 0, 0], [0, 0, 0]);
  model.joints.forEach((joint, i) => {
    frame = multiply(multiply(frame, frameOf(joint.origin_xyz_m, joint.origin_rpy_rad)), turn(q[i] ?? 0));
    frames.push(frame);
  });
  frames.push(multiply(frame, frameOf(model.flange.origin_xyz_m, model.flange.origin_rpy_rad)));
  return frames;
}

export function flange(model: ArmModel, q: readonly number[]): Frame {
  const frames = forward(model, q);
  return frames[frames.length - 1] ?? frameOf([0, 0, 0], [0, 0, 0]);
}

/** Returns roll, pitch and yaw of a frame about fixed axes, rad. */
export function rpy(frame: Frame): Vector {
  const [r00, r10, r20, r21, r22] = [frame[0] ?? 1, frame[4] ?? 0, frame[8] ?? 0, frame[9] ?? 0, frame[10] ?? 1];
  const pitch = Math.atan2(-r20, Math.hypot(r00, r10));
  if (Math.hypot(r00, r10) < 1e-9) return [0, pitch, Math.atan2(-(frame[1] ?? 0), frame[5] ?? 1)];
  return [Math.atan2(r21, r22), pitch, Math.atan2(r10, r00)];
}

/** Returns the orientation of a frame as a quaternion x, y, z, w. w is not negative. */
export function quaternion(frame: Frame): [number, number, number, number] {
  const at = (r: number, c: number) => frame[4 * r + c] ?? 0;
  const trace = at(0, 0) + at(1, 1) + at(2, 2);
  // The computation begins with the largest component, so that it never divides by a small number (Shepperd 1978).
  const parts = [at(0, 0), at(1, 1), at(2, 2), trace];
  const k = parts.indexOf(Math.max(...parts));
  const q: [number, number, number, number] = [0, 0, 0, 0];
  if (k === 3) {
    [q[0], q[1], q[2], q[3]] = [at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1), 1 + trace];
  } else {
    const [i, j, l] = [k, (k + 1) % 3, (k + 2) % 3];
    q[i] = 1 + at(i, i) - at(j, j) - at(l, l);
    q[j] = at(i, j) + at(j, i);
    q[l] = at(i, l) + at(l, i);
    q[3] = at(l, j) - at(j, l);
  }
  const length = Math.hypot(...q) * (q[3] < 0 ? -1 : 1);
  return q.map((value) => value / length) as [number, number, number, number];
}

/** Returns the approximate reach of the arm, m: the sum of its link lengths. */
export function reach(model: ArmModel): number {
  const lengths = [...model.joints.map((joint) => joint.origin_xyz_m), model.flange.origin_xyz_m].map((xyz) => Math.hypot(...xyz));
  return lengths.reduce((sum, length) => sum + length, 0);
}

/** Returns the distance of a joint from its nearer limit: 0 at the limit, 1 in the middle of the range of the joint. */
export function room(joint: JointModel, q: number): number {
  const half = (joint.position_max_rad - joint.position_min_rad) / 2;
  return Math.min(q - joint.position_min_rad, joint.position_max_rad - q) / half;
}
