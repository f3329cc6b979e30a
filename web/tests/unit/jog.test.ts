import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Jogger } from '../../src/lib/arm/jog.ts';
import { History } from '../../src/lib/history.ts';
import { figuresOf, overlay } from '../../src/lib/arm/trial.ts';

function setUp(send: (rates: number[]) => Promise<unknown> = () => Promise.resolve()) {
  const sent: number[][] = [];
  let [tick, time, refusals] = [undefined as (() => void) | undefined, 0, 0];
  const jogger = new Jogger({
    send: (rates) => {
      sent.push(rates);
      return send(rates);
    },
    refused: (_, after) => {
      if (!after) refusals += 1;
    },
    slept: () => {},
    every: (act) => ((tick = act), 1),
    never: () => (tick = undefined),
    now: () => time,
  });
  const pass = async () => {
    await new Promise((done) => setImmediate(done));
    time += 90;
    tick?.();
    await new Promise((done) => setImmediate(done));
  };
  return { jogger, sent, pass, sleep: (ms: number) => (time += ms), runs: () => tick !== undefined, refusals: () => refusals };
}

test('rates as long as it is held, zeros once when it is let go', async () => {
  const { jogger, sent, pass, runs } = setUp();
  jogger.press(3, -0.1);
  await pass();
  await pass();
  jogger.release();
  jogger.release();
  await pass();
  assert.deepEqual(sent, [[0, 0, -0.1, 0, 0, 0], [0, 0, -0.1, 0, 0, 0], [0, 0, -0.1, 0, 0, 0], [0, 0, 0, 0, 0, 0]]);
  assert.ok(!runs());
});

test('a page that was suspended does not jog on', async () => {
  const { jogger, sent, pass, sleep } = setUp();
  jogger.press(2, 0.1);
  await pass();
  sleep(2000);
  await pass();
  assert.ok(!jogger.isHeld);
  assert.deepEqual(sent.at(-1), [0, 0, 0, 0, 0, 0]);
});

test('what is refused is not asked for on', async () => {
  const { jogger, sent, pass, refusals } = setUp(() => Promise.reject(new Error('denied')));
  jogger.press(1, 0.1);
  await pass();
  await pass();
  assert.equal(sent.length, 1);
  assert.equal(refusals(), 1);
  assert.ok(!jogger.isHeld);
});

test('a slow line does not fill with requests', async () => {
  const { jogger, sent, pass } = setUp(() => new Promise(() => {}));
  jogger.press(1, 0.1);
  for (let i = 0; i < 6; i += 1) await pass();
  assert.ok(sent.length <= 4, `${sent.length} sent`);
});

test('zeros go out again behind rates that were on their way', async () => {
  let answer: () => void = () => {};
  const { jogger, sent, pass } = setUp((rates) => (rates[0] ? new Promise<void>((done) => (answer = done)) : Promise.resolve()));
  jogger.press(1, 0.1);
  jogger.release();
  assert.deepEqual(sent.map(([first]) => first), [0.1, 0]);
  answer();
  await pass();
  assert.deepEqual(sent.map(([first]) => first), [0.1, 0, 0]);
});

test('another key lets the first go', async () => {
  const { jogger, sent, pass } = setUp();
  jogger.press(1, 0.1);
  await pass();
  jogger.press(2, 0.1);
  assert.deepEqual(sent.map((rates) => rates.slice(0, 2)), [[0.1, 0], [0.1, 0], [0, 0], [0, 0.1]]);
});

test('history is a ring, and gaps are no values', () => {
  const history = new History(2, 3);
  for (let i = 0; i < 5; i += 1) history.push([i, i === 3 ? NaN : i * 10]);
  assert.deepEqual(history.since(0, [0, 1]), [[2, 3, 4], [20, null, 40]]);
  assert.deepEqual(history.since(4, [1]), [[40]]);
});

test('tests of gains lie over each other from their first motion on', () => {
  const gains = { kp: 1, ki: 1, kd: 1 };
  const trial = (start: number, errors: (number | null)[]) => ({ joint: 1, gains, start, times: errors.map((_, i) => start + i * 0.04), errors, figures: undefined });
  assert.deepEqual(overlay([trial(100, [null, 0.001, 0.002]), trial(200, [0.003, 0.004])]), [[0, 0.04], [1, 2], [3, 4]]);
  assert.deepEqual(figuresOf({ name: 'j', max_error_mrad: 2, rms_error_mrad: 0.5 }, { max: 1, rms: 0.7 }), { max: 2, rms: 0.7 });
});
