import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

import { differences, gainsOf, withGains } from '../../src/lib/arm/armfile.ts';
import { parse, TomlError } from '../../src/lib/arm/toml.ts';

const AVENA = readFileSync(new URL('../../../arms/avena.toml', import.meta.url), 'utf8');

test('an arm file is read, and is the same as itself', () => {
  const arm = parse(AVENA) as { joint: unknown[]; link: unknown[]; name: string };
  assert.equal(arm.name, 'avena');
  assert.equal(arm.joint.length, 7);
  assert.equal(arm.link.length, 7);
  assert.deepEqual(differences(AVENA, AVENA), []);
});

test('comments, texts, inline tables and arrays over lines', () => {
  const text = 'a = "x # y" # c\nb = [1, # one\n 2,\n]\n[t.u]\nc = { d = -1_000.5e0, e = true }\n[[l]]\nf = \'\\n\'\n[l.sub]\ng = 1\n[[l]]\n';
  assert.deepEqual(parse(text), { a: 'x # y', b: [1, 2], t: { u: { c: { d: -1000.5, e: true } } }, l: [{ f: '\\n', sub: { g: 1 } }, {}] });
  assert.throws(() => parse('a = 1\nb = ?'), (error: unknown) => error instanceof TomlError && error.line === 2);
});

test('differences name the place, joints from 1; single precision is the same', () => {
  const file = AVENA.replace('kp = 8000.0', 'kp = 8100.0').replace('position_max_rad = 1.57', 'position_max_rad = 1.5').replace('[0.0, 0.0, 0.063]', '[0.0, 0.0, 0.06300000101327896]');
  assert.deepEqual(differences(AVENA, file), [
    { place: 'joint 1, pid.kp', board: '8000', file: '8100' },
    { place: 'joint 2, position_max_rad', board: '1.57', file: '1.5' },
  ]);
});

test('poses are no difference of the arm; tables of numbers are shown in one line', () => {
  assert.deepEqual(differences(AVENA, `${AVENA}\n[poses]\nhome = [0, 0, 0, 0, 0, 0]\n`), []);
  const table = differences(AVENA, AVENA.replace('-43.39838393343234', '-44.0'));
  assert.equal(table.length, 1);
  assert.match(table[0]?.file ?? '', /1 of them differ/);
});

test('gains are read and written, and nothing else changes', () => {
  assert.deepEqual(gainsOf(AVENA)[3], { kp: 4000, ki: 24000, kd: 60 });
  const changed = withGains(AVENA, 4, { kp: 4200, ki: 23000.5, kd: 61 });
  assert.deepEqual(gainsOf(changed)[3], { kp: 4200, ki: 23000.5, kd: 61 });
  assert.deepEqual(gainsOf(changed)[2], gainsOf(AVENA)[2]);
  assert.equal(withGains(changed, 4, { kp: 4000, ki: 24000, kd: 60 }), AVENA);
  assert.throws(() => withGains('name = "x"\n', 1, { kp: 1, ki: 1, kd: 1 }));
});
