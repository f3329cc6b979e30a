import assert from 'node:assert/strict';
import { test } from 'node:test';

import { type ArmModel, flange, frameOf, quaternion, type Vector } from '../../src/lib/arm/kinematics.ts';
import { namesUnits, rowFor, withRow } from '../../src/lib/arm/rows.ts';

const DEG = Math.PI / 180;
const Q = [0.07, 0.5, -1, 0, 0.8, -1.57];
const IN_DEGREES = Q.map((q) => q / DEG);

const joint = (n: number, xyz: Vector, rpy: Vector) => ({
  joint: n, name: `joint_${n}`, origin_xyz_m: xyz, origin_rpy_rad: rpy, position_min_rad: -3, position_max_rad: 3, velocity_max_rad_s: 1,
  acceleration_max_rad_s2: 1, torque_max_nm: 50,
});
const model: ArmModel = {
  name: 'six', gravity_m_s2: [0, 0, -9.81], links: [],
  joints: [
    joint(1, [0, 0, 0.2], [0, 0, 0]), joint(2, [0, 0, 0.1], [Math.PI / 2, 0, 0]), joint(3, [0.4, 0, 0], [0, 0, 0.3]), joint(4, [0, 0.1, 0], [0, Math.PI / 2, 0]),
    joint(5, [0, 0, 0.3], [-Math.PI / 2, 0, 0]), joint(6, [0.05, 0, 0], [0, 0.4, 0]),
  ],
  flange: { origin_xyz_m: [0, 0, 0.08], origin_rpy_rad: [0.2, 0, 0] },
};

/** Returns the cells of a row in their order, and reads them as the agent does. */
function read(row: string, separator: string): (number | string)[] {
  const cells = separator === ' ' ? row.trim().split(/\s+/) : row.split(separator).map((cell) => cell.trim());
  return cells.map((cell) => (cell === '' || Number.isNaN(Number(cell)) ? cell : Number(cell)));
}

function near(found: readonly (number | string)[], wanted: readonly (number | string)[], what: string): void {
  assert.equal(found.length, wanted.length, `${what}: ${found}`);
  wanted.forEach((value, i) => {
    const is = found[i];
    if (typeof value === 'string') assert.equal(is, value, what);
    else assert.ok(typeof is === 'number' && Math.abs(is - value) < 2e-6, `${what}: ${is} is not ${value}`);
  });
}

/** Headers, the switch for degrees, and the expected cells of a row below the header. */
const JOINT_HEADERS: [header: string, degrees: boolean, separator: string, cells: (number | string)[]][] = [
  ['q1,q2,q3,q4,q5,q6', false, ',', Q],
  ['q1,q2,q3,q4,q5,q6', true, ',', IN_DEGREES],
  ['q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg', false, ',', IN_DEGREES],
  ['q1_deg, q2_deg, q3_deg, q4_deg, q5_deg, q6_deg', true, ',', IN_DEGREES],
  ['Q1_DEG,Q2_Deg,q3_dEG,Q4_DEG,Q5_DEG,Q6_DEG', false, ',', IN_DEGREES],
  ['q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad', true, ',', Q],
  ['Q1_RAD;Q2_RAD;Q3_RAD;Q4_RAD;Q5_RAD;Q6_RAD', true, ';', Q],
  ['q1_deg q2_deg q3_deg q4_deg q5_deg q6_deg', false, ' ', IN_DEGREES],
  ['t,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg', false, ',', ['', ...IN_DEGREES]],
  ['Time_s q1 q2 q3 q4 q5 q6', false, ',', ['', ...Q]],
  ['pose,q1,q2,q3,q4,q5,q6', false, ',', ['', ...Q]],
  ['q6_deg,q5_deg,q4_deg,q3_deg,q2_deg,q1_deg', false, ',', [...IN_DEGREES].reverse()],
  ['q1_deg,q2,q3_rad,q4_deg,q5,q6', false, ',', [Q[0]! / DEG, Q[1]!, Q[2]!, Q[3]! / DEG, Q[4]!, Q[5]!]],
  ['"q1_deg","q2_deg","q3_deg","q4_deg","q5_deg","q6_deg"', false, ',', IN_DEGREES],
  ['# in degrees\r\n\r\nq1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\r\n0,0,0,0,0,0', false, ',', IN_DEGREES],
  ['\uFEFFq1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg', false, ',', IN_DEGREES],
  ['q1_deg, q2_deg, q3_deg, q4_deg, q5_deg, q6_deg, x, y, z, roll_deg, pitch_deg, yaw_deg, leg', false, ',', [...IN_DEGREES, '', '', '', '', '', '', '']],
  ['leg;t;name;Q1_Deg;Q2_Deg;Q3_Deg;Q4_Deg;Q5_Deg;Q6_Deg', true, ';', ['', '', '', ...IN_DEGREES]],
];

test('a row is in the columns, units and separator of the header', () => {
  for (const [header, degrees, separator, cells] of JOINT_HEADERS) {
    const made = rowFor(header, { q: Q, pose: 'pick' }, degrees, model);
    assert.ok('row' in made, `${header}: ${JSON.stringify(made)}`);
    near(read(made.row, separator), cells, header);
  }
});

test('a row of the flange is its pose, in the units of the header', () => {
  const frame = flange(model, Q);
  const xyz = [frame[3]!, frame[7]!, frame[11]!];
  // The cells must contain roll, pitch and yaw of this frame, in the order of the file.
  const angles = (cells: (number | string)[], unit: number) => frameOf(xyz as Vector, cells.map((cell) => Number(cell) * unit) as Vector);
  const cases: [string, boolean, number][] = [
    ['x,y,z,roll,pitch,yaw', false, 1], ['x,y,z,roll,pitch,yaw', true, DEG], ['x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg', false, DEG], ['X,Y,Z,Roll_RAD,Pitch_RAD,Yaw_RAD', true, 1],
  ];
  for (const [header, degrees, unit] of cases) {
    const made = rowFor(header, { q: Q }, degrees, model);
    assert.ok('row' in made, header);
    const cells = read(made.row, ',');
    near(cells.slice(0, 3), xyz, header);
    near(angles(cells.slice(3), unit), frame, header);
  }
  const made = rowFor('t,pose,x,y,z,qx,qy,qz,qw,roll,pitch,yaw,leg', { q: Q }, true, model);
  assert.ok('row' in made);
  near(read(made.row, ','), ['', '', ...xyz, ...quaternion(frame), '', '', '', ''], 'a quaternion');
  const named = rowFor('t,pose,x,y,z,roll,pitch,yaw', { q: Q, pose: 'pick' }, false);
  assert.deepEqual(named, { row: ',pick,,,,,,' });
  assert.deepEqual(rowFor('Pose', { q: Q, pose: 'pick' }, false), { row: 'pick' });
});

test('a quaternion is that of the rotation, also half a turn about each axis', () => {
  for (const rpy of [[0, 0, 0], [Math.PI, 0, 0], [0, Math.PI, 0], [0, 0, Math.PI], [0.3, -0.4, 1.1], [3, 0.1, -3], [-2, 1.5, 2], [1, 0, -1], [0, -1.2, 3.1], [1e-9, 3.1, 0]] as Vector[]) {
    const frame = frameOf([0, 0, 0], rpy);
    const [x, y, z, w] = quaternion(frame);
    near([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0, 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0, 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], frame.slice(0, 11), `${rpy}`);
  }
});

/** Files to which no row can be added, each with a part of the reason. */
const REFUSED: [text: string, reason: RegExp][] = [
  ['[{"q1_deg": 0}]', /JSON/],
  ['  {"waypoints": []}', /JSON/],
  ['0,0,0,0,0,0\n', /no header.*q1,q2,q3,q4,q5,q6/],
  ['0 0.5 -1e-3 0 0 0', /no header/],
  ['t,q1,q2,q3,q4,q5,q6,qd1,qd2,qd3,qd4,qd5,qd6', /column "qd1"/],
  ['q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,comment', /column "comment"/],
  ['q1_grad,q2,q3,q4,q5,q6', /column "q1_grad"/],
  ['q1,q2,q3,q4,q5,q7', /column "q7"/],
  ['q1,q2,q3,q4,q5', /lacks q6/],
  ['q1,q1_deg,q2,q3,q4,q5,q6', /column q1 twice/],
  ['pose', /poses by their names/],
  ['t,pose,leg', /poses by their names/],
  ['x,y,z,yaw', /lacks roll, pitch/],
  ['x,y,z,qx,qy,qz', /lacks qw/],
  ['x,y,z', /lacks roll, pitch, yaw/],
  ['roll,pitch,yaw', /lacks x, y, z/],
  ['t', /lacks q1/],
  ['constructor,q1,q2,q3,q4,q5,q6', /column "constructor"/],
  ['q1,q2,q3,q4,q5,q6,', /column ""/],
];

test('a file that cannot take a row says why, and stays as it is', () => {
  for (const [text, reason] of REFUSED) {
    const made = withRow(text, { q: Q }, false, model);
    assert.ok('problem' in made, `${text}: ${JSON.stringify(made)}`);
    assert.match(made.problem, reason);
  }
  const unknown = withRow('x,y,z,roll,pitch,yaw', { q: Q }, false);
  assert.ok('problem' in unknown && /model/.test(unknown.problem));
});

test('a row is added below what is there; an empty file gets a header', () => {
  const row = Q.map((q) => q.toFixed(6)).join(',');
  for (const empty of ['', '\n  \n', '\r\n']) assert.deepEqual(withRow(empty, { q: Q }, false), { text: `q1,q2,q3,q4,q5,q6\n${row}\n`, row });
  assert.deepEqual(withRow('# mine\n', { q: Q }, false), { text: `# mine\nq1,q2,q3,q4,q5,q6\n${row}\n`, row });
  const before = 'q1,q2,q3,q4,q5,q6\n1,2,3,4,5,6';
  for (const text of [before, `${before}\n`, `${before}\n\n\n`]) assert.deepEqual(withRow(text, { q: Q }, false), { text: `${before}\n${row}\n`, row });
});

test('a header names its units in any letter case', () => {
  for (const header of ['q1_deg,q2', 'Q1_DEG,q2', 'q1,q2_Rad', '"q1_DEG"', '# q\nx,y,z,roll_deg', '\uFEFFQ1_RAD', '[{"q1_deg": 0}]']) assert.ok(namesUnits(header), header);
  for (const header of ['', '# q1_deg', 'q1,q2', 'x_m,y_m', 'pose', 'degrees', '[{"q1": 0}]', '0,0\nq1_deg']) assert.ok(!namesUnits(header), header);
});
