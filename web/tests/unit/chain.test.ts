import assert from 'node:assert/strict';
import { test } from 'node:test';

import { phaseOf } from '../../src/lib/chain/phases.ts';
import { EVERY_MS, Sender } from '../../src/lib/chain/sender.ts';
import { given, minus, nameParts, rangeOf, stepOf, text, typed, unitWords } from '../../src/lib/chain/signals.ts';
import type { BoardObject, Status } from '../../src/lib/chain/types.ts';
import { boardList, boardWords, busWords, eventWords, stoppedWords } from '../../src/lib/chain/words.ts';

/** Clock that the test sets. */
class Clock {
  time = 0;
  #waiting: { at: number; act: () => void }[] = [];
  later = (act: () => void, ms: number) => {
    const one = { at: this.time + ms, act };
    this.#waiting.push(one);
    return one;
  };
  never = (handle: unknown) => {
    this.#waiting = this.#waiting.filter((one) => one !== handle);
  };
  async pass(ms: number): Promise<void> {
    for (let i = 0; i < ms; i += 1) {
      this.time += 1;
      const due = this.#waiting.filter((one) => one.at <= this.time);
      this.#waiting = this.#waiting.filter((one) => one.at > this.time);
      for (const one of due) one.act();
      for (let k = 0; k < 4; k += 1) await Promise.resolve();
    }
  }
}

function sender(answer: (value: number) => Promise<void> = () => Promise.resolve()) {
  const clock = new Clock();
  const sent: { value: number; at: number }[] = [];
  const busy: boolean[] = [];
  let refused = 0;
  const made = new Sender<number>({
    send: (value) => {
      sent.push({ value, at: clock.time });
      return answer(value);
    },
    refused: () => (refused += 1),
    changed: (now) => busy.push(now),
    now: () => clock.time,
    later: clock.later,
    never: clock.never,
  });
  return { clock, sent, busy, made, refused: () => refused };
}

test('values are sent ten times a second at most, and the last one always', async () => {
  const { clock, sent, made, busy } = sender();
  for (let i = 0; i < 50; i += 1) {
    made.put(i);
    await clock.pass(7);
  }
  await clock.pass(200);
  assert.ok(sent.length <= 5 && sent.length >= 4, JSON.stringify(sent));
  sent.slice(1).forEach((each, i) => assert.ok(each.at - (sent[i]?.at ?? 0) >= EVERY_MS));
  assert.equal(sent.at(-1)?.value, 49);
  assert.equal(busy.at(-1), false);
});

test('one request at a time: what comes meanwhile waits, and only the newest of it is sent', async () => {
  let answer = () => {};
  const { clock, sent, made } = sender(() => new Promise<void>((done) => (answer = done)));
  made.put(1);
  made.put(2);
  made.put(3);
  await clock.pass(500);
  assert.deepEqual(sent.map(({ value }) => value), [1]);
  answer();
  await clock.pass(EVERY_MS + 2);
  assert.deepEqual(sent.map(({ value }) => value), [1, 3]);
});

test('what waits is dropped by a Stop, and by a refusal', async () => {
  const dropped = sender();
  dropped.made.put(1);
  dropped.made.put(2);
  dropped.made.drop();
  await dropped.clock.pass(500);
  assert.deepEqual(dropped.sent.map(({ value }) => value), [1]);
  assert.equal(dropped.busy.at(-1), false);
  const refused = sender(() => Promise.reject(new Error('no')));
  refused.made.put(1);
  refused.made.put(2);
  await refused.clock.pass(500);
  assert.deepEqual([refused.sent.length, refused.refused()], [1, 1]);
});

const value = (over: object) => ({ name: 'set_position [0.01 deg]', index: 0, ...over });

test('names, units and ranges of signals', () => {
  assert.deepEqual(nameParts('set_position [0.01 deg]'), { name: 'set_position', step: '0.01 deg' });
  assert.deepEqual(nameParts('mode'), { name: 'mode', step: '' });
  assert.equal(unitWords(value({ unit: 'deg' })), 'deg');
  assert.equal(unitWords(value({})), '× 0.01 deg');
  assert.equal(unitWords(value({ name: 'kp [mA/deg]' })), 'mA/deg');
  assert.deepEqual(rangeOf(value({ unit: 'deg', value: 3, min: -60, max: 60 }), { min: 0, max: 1 }), { min: -60, max: 60, step: 0.1, by: 'table' });
  assert.deepEqual(rangeOf(value({ value: 3 }), { min: 0, max: 500 }), { min: 0, max: 500, step: 1, by: 'page' });
  assert.deepEqual(rangeOf(value({ value: -4200 }), undefined), { min: -4200, max: 4200, step: 10, by: 'nobody' });
  assert.deepEqual(rangeOf(value({ value: 50_000 }), undefined).min, -32768);
  assert.equal(stepOf(0, 100, true), 1);
  assert.equal(text(20, 0.1, 'deg'), '20.0 deg');
  assert.equal(minus('-10.25 deg'), '\u221210.25 deg');
});

test('a value goes with its unit where it has one', () => {
  assert.equal(given(-20.04, 0.1, 'deg'), '-20.0 deg');
  assert.equal(given(20, 1, undefined), 20);
  assert.equal(typed('15,5', 'deg'), '15.5 deg');
  assert.equal(typed('\u221215', undefined), -15);
  assert.equal(typed('0x05DC', 'deg'), '0x05DC');
  assert.equal(typed('15 rad', 'deg'), '15 rad');
  assert.equal(typed('  ', 'deg'), undefined);
});

const board = (over: Partial<BoardObject>): BoardObject => ({
  number: 1, state: 'running', heartbeat: 'alive', status: [], active: false, application: true, errors: 0, frames_per_s: 0, ...over,
});
const status = (over: Partial<Status> = {}): Status => ({
  simulated: false, bus: 'can0', age_ms: 0, at_ms: 0, last_halt: 0, boards: 1, load_percent: 0, received: 0, sent: 0, foreign_frames: 0, is_master: true,
  competing_master: false, shared_numbers: [], role: 'operator', agent: 'a', last_event: 0, ...over,
});

test('a lost board comes before all that still goes well, and what a wire disturbs before that', () => {
  const boards = [board({ active: true }), board({ number: 2, state: 'lost', heartbeat: 'lost' })];
  assert.equal(busWords(status(), boards, undefined).word, 'Board 2 is lost');
  assert.equal(busWords(status({ controller: { bus_off: true, passive: true, times_bus_off: 1 } }), boards, undefined).word, 'Bus-off');
  assert.equal(busWords(status({ competing_master: true }), boards, undefined).word, 'Competing master');
  assert.equal(busWords(status({ shared_numbers: ['1: two boards'] }), boards, undefined).step, 'init');
  assert.equal(busWords(status(), [board({ active: true })], undefined).tone, 'move');
  assert.equal(busWords(status(), [], undefined).step, 'scan');
  assert.equal(busWords(status(), [board({ state: 'exloader' })], undefined).word, 'At rest');
});

test('each state of a board has a word, and outputs make the difference', () => {
  const words = ['exloader', 'programming', 'started', 'running', 'lost', 'rebooted', '?'].map((state) => boardWords(board({ state })).word);
  assert.equal(new Set(words).size, words.length);
  assert.notEqual(boardWords(board({ active: true })).tone, boardWords(board({ active: false })).tone);
  assert.equal(boardWords(board({ heartbeat: 'late', active: true })).tone, 'error');
  assert.equal(boardWords(board({ state: 'exloader', application: false })).word, 'No program');
});

test('what a Stop did is said by those who confirmed it, and who did not comes first', () => {
  assert.equal(stoppedWords({ kind: 'stopped', boards: [1, 2], not_stopped: [] }).text, 'Stopped: boards 1 and 2 confirmed it.');
  const bad = stoppedWords({ kind: 'stopped', boards: [1], not_stopped: ['board 2: no answer'] });
  assert.ok(bad.failed && bad.text.startsWith('NOT STOPPED: board 2. Use the emergency stop.'));
  assert.equal(bad.why, 'board 2: no answer');
  assert.match(stoppedWords({ kind: 'stopped', boards: [1], not_stopped: [] }, false).text, /No board was running/);
  assert.equal(boardList([1]), 'board 1');
  assert.equal(eventWords({ kind: 'progress', job: 1, boards: [1], attempt: 1, cycle: 1, bytes: 0, total: 1 }), undefined);
});

test('an update is in the phase in which it can still be cancelled, or not', () => {
  const at = (cycle: number, bytes: number) => phaseOf({ progress: { boards: [1], attempt: 1, cycle, bytes, total: 100 } });
  assert.deepEqual([at(1, 20)?.at, at(2, 60)?.at, at(2, 100)?.at], [0, 1, 2]);
  assert.match(at(1, 20)?.words ?? '', /nothing erased/);
  assert.equal(phaseOf({ progress: undefined }), undefined);
});
