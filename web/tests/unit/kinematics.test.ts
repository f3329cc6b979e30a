import assert from 'node:assert/strict';
import { test } from 'node:test';

import { type ArmModel, flange, forward, frameOf, multiply, place, reach, room, rpy, transform, turn } from '../../src/lib/arm/kinematics.ts';
import { previewAt, wayOf } from '../../src/lib/arm/preview.ts';

const near = (a: readonly number[], b: readonly number[], within = 1e-9) => {
  assert.equal(a.length, b.length);
  a.forEach((value, i) => assert.ok(Math.abs(value - (b[i] ?? NaN)) < within, `${a} is not ${b}`));
};

const joint = (n: number, xyz: [number, number, number], axis: [number, number, number] = [0, 0, 0]) => ({
  joint: n, name: `joint_${n}`, origin_xyz_m: xyz, origin_rpy_rad: axis, position_min_rad: -2, position_max_rad: 3, velocity_max_rad_s: 1,
  acceleration_max_rad_s2: 1, torque_max_nm: 50,
});
/** A planar arm: two links of 1 m that rotate about z. The origins of the other joints coincide. */
const planar: ArmModel = {
  name: 'planar', gravity_m_s2: [0, 0, -9.81], links: [],
  joints: [joint(1, [0, 0, 0]), joint(2, [1, 0, 0]), joint(3, [1, 0, 0]), joint(4, [0, 0, 0]), joint(5, [0, 0, 0]), joint(6, [0, 0, 0])],
  flange: { origin_xyz_m: [0, 0, 0.1], origin_rpy_rad: [0, 0, 0] },
};

test('rpy is about fixed axes: yaw · pitch · roll', () => {
  const [r, p, y] = [0.3, -0.4, 1.1];
  const about = (rpyOne: [number, number, number]) => frameOf([0, 0, 0], rpyOne);
  near(frameOf([1, 2, 3], [r, p, y]), multiply(multiply(multiply(frameOf([1, 2, 3], [0, 0, 0]), about([0, 0, y])), about([0, p, 0])), about([r, 0, 0])));
  near(rpy(frameOf([0, 0, 0], [r, p, y])), [r, p, y]);
  near(rpy(frameOf([0, 0, 0], [0, Math.PI / 2, 0.5])), [0, Math.PI / 2, 0.5], 1e-6);
});

test('a planar arm is where geometry says', () => {
  near(place(flange(planar, [0, 0, 0, 0, 0, 0])), [2, 0, 0.1]);
  near(place(flange(planar, [Math.PI / 2, -Math.PI / 2, 0, 0, 0, 0])), [1, 1, 0.1]);
  assert.equal(forward(planar, [0, 0, 0, 0, 0, 0]).length, 7);
  near(transform(turn(Math.PI / 2), [1, 0, 0]), [0, 1, 0]);
  assert.ok(Math.abs(reach(planar) - 2.1) < 1e-12);
});

test('room is 1 in the middle, 0 at a limit, negative beyond', () => {
  const [one] = planar.joints;
  assert.ok(one);
  assert.equal(room(one, 0.5), 1);
  assert.equal(room(one, 3), 0);
  assert.ok(room(one, -2.1) < 0);
});

test('a preview goes between its points, and stays at its ends', () => {
  const points = { number: 1, name: 'x', duration_s: 2, times_s: [0, 1, 2], positions_rad: [[0], [1], [5]] };
  near(previewAt(points, 0.25), [0.25]);
  near(previewAt(points, 1.5), [3]);
  near(previewAt(points, -1), [0]);
  near(previewAt(points, 9), [5]);
});

test('problems are shown where the flange is then', () => {
  const points = { number: 1, name: 'x', duration_s: 1, times_s: [0, 1], positions_rad: [[0, 0, 0, 0, 0, 0], [Math.PI / 2, 0, 0, 0, 0, 0]] };
  const way = wayOf(planar, points, [{ message: 'fast', point: 1, time_s: 1, warning: false }]);
  near(way.places[0]?.at ?? [], [0, 2, 0.1]);
  assert.equal(way.line.length, 2);
});
