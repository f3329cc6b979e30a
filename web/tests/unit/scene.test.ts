import assert from 'node:assert/strict';
import { test } from 'node:test';

import { type ArmModel, flange, transform, type Vector } from '../../src/lib/arm/kinematics.ts';
import { ArmScene, type Palette, type Renderer } from '../../src/lib/arm/scene.ts';

/** A canvas without a browser. The controls of the view listen to its events. */
class Canvas extends EventTarget {
  style = {};
  ownerDocument = new EventTarget();
  getRootNode(): EventTarget {
    return this.ownerDocument;
  }
}
globalThis.requestAnimationFrame = () => 0;

const LIGHT: Palette = {
  ground: '#fff', surface: '#fff', line: '#ccc', ink: '#333', accent: '#06c', warn: '#c80', error: '#c00', ghost: '#808', body: '#eee', link: '#ddd', cap: '#444',
  dark: false,
};
const DARK: Palette = { ...LIGHT, ground: '#111', surface: '#222', body: '#d3dae1', dark: true };

const joint = (n: number, xyz: Vector, rpy: Vector) => ({
  joint: n, name: `joint_${n}`, origin_xyz_m: xyz, origin_rpy_rad: rpy, position_min_rad: -3, position_max_rad: 3, velocity_max_rad_s: 1,
  acceleration_max_rad_s2: 1, torque_max_nm: 50,
});
function model(length = 0.4): ArmModel {
  return {
    name: 'six', gravity_m_s2: [0, 0, -9.81], links: [],
    joints: [
      joint(1, [0, 0, 0.2], [0, 0, 0]), joint(2, [0, 0, 0.1], [Math.PI / 2, 0, 0]), joint(3, [length, 0, 0], [0, 0, 0.3]), joint(4, [0, 0.1, 0], [0, Math.PI / 2, 0]),
      joint(5, [0, 0, 0.3], [-Math.PI / 2, 0, 0]), joint(6, [0.05, 0, 0], [0, 0.4, 0]),
    ],
    flange: { origin_xyz_m: [0, 0, 0.08], origin_rpy_rad: [0.2, 0, 0] },
  };
}

function scene(): ArmScene {
  const renderer = { shadowMap: {}, render: () => {}, setPixelRatio: () => {}, setSize: () => {}, dispose: () => {} } as unknown as Renderer;
  return new ArmScene(new Canvas() as unknown as HTMLCanvasElement, LIGHT, renderer);
}

/** Ten poses of an arm at rest: zero pose, one joint moved, all joints moved, near limits, and tiny positions. */
const POSES: number[][] = [
  [0, 0, 0, 0, 0, 0], [0.14, 0.5, -1, 0, 0.8, 0], [0, 0, -0.47, 0, 0, 0], [2.99, -2.99, 2.99, -2.99, 2.99, -2.99], [0, 0, 0, 0, 0, 1.57],
  [-1.2, 0.3, 0.3, 0.3, 0.3, 0.3], [1e-5, -1e-5, 1e-5, 0, 0, 0], [0.0001, 0.5, -1.0001, 0.0004, 0.8, 0.0001], [-0.7, -0.6, 1.1, 0.4, 0.7, 0.2], [3, 3, 3, 3, 3, 3],
];
const COM: Vector = [0.01, -0.02, 0.06];
const GHOST_OFF = 0.2;

/** Changes that create new bodies while the arm is at rest. */
const CHANGES: Record<string, (drawn: ArmScene) => void> = {
  'a dark theme': (drawn) => drawn.paint(DARK),
  'a dark theme and a light one again': (drawn) => {
    drawn.paint(DARK);
    drawn.paint(LIGHT);
  },
  'the same arm, read again': (drawn) => drawn.setModel(model()),
  'a longer arm': (drawn) => drawn.setModel(model(0.6)),
  'the arm read again, then the theme': (drawn) => {
    drawn.setModel(model(0.6));
    drawn.paint(DARK);
  },
  'the arm read again, and the same position once more': (drawn) => {
    const { measured } = drawn.posed;
    drawn.setModel(model());
    drawn.setMeasured(measured);
  },
};

for (const [name, change] of Object.entries(CHANGES)) {
  test(`an arm at rest is drawn where it stands after ${name}`, () => {
    for (const q of POSES) {
      const drawn = scene();
      drawn.setModel(model());
      drawn.setPayload(1.5, COM);
      drawn.setMeasured(q);
      const preview = q.map((value) => value - GHOST_OFF);
      drawn.setGhost(preview, true);
      change(drawn);
      const { measured, ghost, ghostShown, payload } = drawn.posed;
      assert.deepEqual(measured, q, 'measured');
      assert.deepEqual([ghost, ghostShown], [preview, true], 'preview');
      const length = name.includes('longer') || name.endsWith('then the theme') ? 0.6 : 0.4;
      transform(flange(model(length), q), COM).forEach((value, i) => assert.ok(Math.abs(value - (payload[i] ?? NaN)) < 1e-6, `payload at ${payload} for ${q}`));
    }
  });
}

test('what came before the arm was read is drawn when it is', () => {
  for (const q of POSES) {
    const drawn = scene();
    drawn.setPayload(1.5, COM);
    drawn.setMeasured(q);
    drawn.setGhost(q, true);
    drawn.setModel(model());
    assert.deepEqual(drawn.posed.measured, q);
    assert.deepEqual([drawn.posed.ghost, drawn.posed.ghostShown], [q, true]);
  }
});

test('a ghost that is hidden stays hidden, and a position that is not known stays so', () => {
  for (const change of Object.values(CHANGES).slice(0, 5)) {
    const drawn = scene();
    drawn.setModel(model());
    drawn.setMeasured(POSES[1]);
    // The commanded pose equals the measured pose, so the scene must not show the ghost.
    drawn.setGhost(POSES[1]);
    change(drawn);
    assert.equal(drawn.posed.ghostShown, false);
    drawn.setGhost(POSES[2], true);
    drawn.setGhost(undefined);
    drawn.setMeasured(undefined);
    change(drawn);
    assert.deepEqual([drawn.posed.measured, drawn.posed.ghostShown, drawn.posed.lost], [POSES[1], false, true]);
  }
});

test('a joint that moves after a new theme is drawn where it is', () => {
  const drawn = scene();
  drawn.setModel(model());
  drawn.setMeasured(POSES[1]);
  drawn.paint(DARK);
  drawn.setMeasured(POSES[2]);
  assert.deepEqual(drawn.posed.measured, POSES[2]);
});
