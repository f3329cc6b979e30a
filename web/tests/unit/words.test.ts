import assert from 'node:assert/strict';
import { test } from 'node:test';

import { explained } from '../../src/lib/arm/explain.ts';
import type { Controller } from '../../src/lib/arm/types.ts';
import { causesOf, defaultsWords, eventWords, isHeld, noJog, stateWords, whatStopDid } from '../../src/lib/arm/words.ts';
import { angle, duration, number, parse } from '../../src/lib/format.ts';
import { deviceKind, takesText } from '../../src/lib/keys.ts';

function controller(change: Partial<Controller> = {}): Controller {
  const joints = Array.from({ length: 6 }, (_, i) => ({ joint: i + 1, state: 'OperationEnable', errors: [] as string[], error_codes: [] as string[], velocity_rad_s: 0, position_rad: 0 }));
  return { state: 'HoldPos', trajectory: 'Null', point: 0, errors: [], error_codes: [], causes: [], errors_occurred: [], next: '', joints, ...change };
}

test('each state has a word, and says what leads on', () => {
  const cases: [Partial<Controller>, string, string][] = [
    [{}, 'Holding', 'hold'],
    [{ state: 'Operate', trajectory: 'Execute' }, 'Moving', 'move'],
    [{ state: 'HoldPos', trajectory: 'Pause' }, 'Paused', 'pause'],
    [{ state: 'Teaching' }, 'Teaching', 'teach'],
    [{ state: 'Init' }, 'No torque', 'off'],
    [{ state: 'Error' }, 'Error', 'error'],
    [{ state: 'Error', errors: ['emergency input'], causes: ['emergency input'] }, 'Error', 'error'],
    [{ errors: ['joint error'], error_codes: ['internal-joint-error'], causes: ['joint 3: torque over limit'] }, 'Held stop', 'error'],
  ];
  for (const [change, word, tone] of cases) {
    const words = stateWords(controller(change), undefined, []);
    assert.deepEqual([words.word, words.tone], [word, tone]);
    assert.ok(words.detail !== '');
  }
  assert.equal(stateWords(controller({ state: 'Init' }), undefined, ['friction']).step, 'which-arm');
  const held = controller({ state: 'Teaching', errors: ['joint error'], error_codes: ['internal-joint-error'], causes: ['joint 3: torque over limit'] });
  assert.deepEqual([stateWords(held, undefined, []).word, stateWords(held, undefined, []).step], ['Teaching', 'teach-off']);
  held.state = 'HoldPos';
  assert.equal(stateWords(held, undefined, []).step, 'acknowledge');
  assert.match(noJog(held), /Held stop/);
  assert.match(stateWords(controller({ state: 'Init' }), undefined, ['friction']).detail, /friction/);
});

test('a held stop shows what the controller found, and what to do about that', () => {
  const stop = { kind: 'push', number: 2, code: 'held-stop-push', joint: 2, value: 61.5, limit: 54, unit: 'N·m', text: 'joint 2 was pushed: …', remedy: 'remove what pushes the joint', since_s: 12 };
  const held = controller({ errors: ['internal joints error'], error_codes: ['internal-joint-error'], causes: ['joint 2: torque over limit'], held_stop: stop });
  const words = stateWords(held, undefined, []);
  assert.equal(words.detail, 'Joint 2 was pushed: …. The arm is held.');
  assert.equal(words.next, 'Remove what pushes the joint, then acknowledge. Nothing moves until then.');
  assert.deepEqual(words.causes, [{ words: 'Joint 2 was pushed: …', code: 'held-stop-push' }, { words: 'Joint 2: torque over limit', code: 'joint 2: torque over limit' }]);
  assert.equal(words.step, 'acknowledge');
  held.held_stop = { ...stop, kind: 'encoder-jump', remedy: 'support the arm, …, then recover' };
  assert.equal(stateWords(held, undefined, []).next, 'Support the arm, …, then recover.');
  // This agent does not know the cause.
  delete held.held_stop;
  assert.match(stateWords(held, undefined, []).next, /^Remove what it met/);
});

test('an encoder that has jumped is shown until its drive was reset', () => {
  const words = stateWords(controller({ encoder_jumped: [3], next: 'support the arm' }), undefined, []);
  assert.deepEqual([words.word, words.detail, words.next], ['Holding', 'Encoder jumped: joint 3. No trajectory is executed.', 'Support the arm.']);
});

test('held is held only when every drive is enabled', () => {
  const late = controller();
  for (const joint of late.joints.slice(2, 4)) joint.state = 'in transition';
  assert.ok(!isHeld(late));
  assert.match(stateWords(late, undefined, []).detail, /joints 3, 4 are being enabled/);
  assert.ok(isHeld(controller()));
});

test('the question before defaults are used names the arm', () => {
  const cases: [Parameters<typeof defaultsWords>[0], boolean, RegExp, RegExp, RegExp, boolean][] = [
    [{ arm: 'avena', defaults_stored: false }, false, /^Is this an avena\?$/, /built-in masses, friction and gains/, /^Recover as avena$/, true],
    [{ arm: 'avena', defaults_stored: false }, true, /^Is this an avena\?$/, /simulated/, /^Recover as avena$/, false],
    [{ arm: 'Orion', defaults_stored: false }, false, /an Orion/, /built-in/, /as Orion/, true],
    [{ arm: 'six', defaults_stored: false }, false, /a six/, /built-in/, /as six/, true],
    [{ arm: 'line-2', defaults_stored: true }, false, /^Is this line-2\?$/, /stored in it/, /as line-2/, true],
    [{ arm: 'avena', defaults_stored: true }, true, /^Is this avena\?$/, /simulated.*stored in it/, /as avena/, false],
    [{ arm: '', defaults_stored: false }, false, /the built-in arm/, /built-in/, /as the built-in arm/, true],
    [undefined, false, /the built-in arm/, /built-in/, /as the built-in arm/, true],
  ];
  for (const [info, simulated, question, used, button, risk] of cases) {
    const words = defaultsWords(info, simulated);
    assert.match(words.question, question);
    assert.match(words.used, used);
    assert.match(words.button, button);
    assert.equal(words.risk !== '', risk);
  }
});

test('jogging that is not possible has a reason', () => {
  const late = controller();
  late.joints[2]!.state = 'in transition';
  const job = (stage: 'begun' | 'uploading' | 'executing') => ({ what: 'run mine', stage });
  const cases: [Controller | undefined, ReturnType<typeof job> | undefined, RegExp][] = [
    [controller(), job('uploading'), /^A motion is being uploaded\./],
    [controller({ trajectory: 'Finish' }), job('uploading'), /^A motion is being uploaded\./],
    [controller({ trajectory: 'TransNullToStop' }), undefined, /^A motion is being uploaded\./],
    [controller(), job('begun'), /^Run mine is being prepared\./],
    [controller(), job('executing'), /^Run mine is running\./],
    [controller({ state: 'Operate', trajectory: 'Execute' }), job('executing'), /^Run mine is running\./],
    [controller({ state: 'Operate', trajectory: 'Execute' }), undefined, /^A motion is running\./],
    [controller({ state: 'HoldPos', trajectory: 'Pause' }), undefined, /^A motion is paused\./],
    [controller({ state: 'Operate', trajectory: 'Pause' }), job('executing'), /^A motion is paused\./],
    [controller({ state: 'Teaching' }), undefined, /needs the arm to hold position\. Teaching: End teaching/],
    [controller({ state: 'Init' }), undefined, /needs the arm to hold position\. No torque: Recover/],
    [controller({ state: 'Error', causes: ['joint 3: torque'] }), job('uploading'), /needs the arm to hold position\. Error: /],
    [late, undefined, /needs the arm to hold position\. Enabling: /],
    [undefined, undefined, /not known/],
  ];
  for (const [now, course, reason] of cases) assert.match(noJog(now, course), reason);
  for (const trajectory of ['Null', 'Stop', 'Finish']) assert.equal(noJog(controller({ trajectory })), '');
});

test('the first cause is the detail, and each goes to explain as it is', () => {
  const wrong = controller({ state: 'Error', causes: ['joint 3: torque', 'emergency input'] });
  assert.deepEqual(causesOf(wrong)[0], { words: 'Joint 3: torque', code: 'joint 3: torque' });
  assert.equal(stateWords(wrong, undefined, []).detail, 'Joint 3: torque. All torques are off.');
});

test('what Stop did is said in words', () => {
  assert.match(whatStopDid('HoldPos', false, controller(), 200), /Nothing was moving; the arm is held/);
  assert.match(whatStopDid('Operate', true, controller({ state: 'Operate', trajectory: 'Execute' }), 200), /decelerates/);
  assert.match(whatStopDid('Operate', true, controller({ trajectory: 'Stop' }), 640), /Stopped on the path in 0\.6 s; the arm is held/);
  assert.match(whatStopDid('Teaching', false, controller(), 200), /Teaching ended; the arm is held/);
  assert.match(whatStopDid('Operate', true, undefined, 200), /No status has come/);
});

test('events in words; progress is no line', () => {
  assert.equal(eventWords({ kind: 'moving', job: 1, phase: 'motion', point: 3 }), undefined);
  assert.deepEqual(eventWords({ kind: 'halt', by: 'anna', command: 'stop' }), { text: 'Stop by anna', tone: 'warn', of: 'halt' });
  assert.equal(eventWords({ kind: 'ended', job: 2, outcome: 'failed', error: { code: 'x', message: 'too fast', next: '' } })?.text, 'Ended: too fast');
});

test('numbers: dash where not known, no negative zero, a true minus', () => {
  assert.equal(number(undefined, 2), '–');
  assert.equal(number(NaN, 2), '–');
  assert.equal(number(-0.001, 2), '0.00');
  assert.equal(number(-1.5, 1), '\u22121.5');
  assert.equal(angle(Math.PI, 'deg'), '180.0');
  assert.equal(parse('\u22120,5'), -0.5);
  assert.ok(Number.isNaN(parse('')));
  assert.deepEqual([4.21, 61, 7390, undefined].map(duration), ['4.2 s', '1:01 min', '2:03:10 h', '–']);
});

test('the space bar is text in fields alone', () => {
  assert.ok(takesText({ tagName: 'INPUT', type: 'text' }) && takesText({ tagName: 'TEXTAREA' }) && takesText({ tagName: 'DIV', isContentEditable: true }));
  assert.ok(!takesText({ tagName: 'BUTTON' }) && !takesText({ tagName: 'INPUT', type: 'range' }) && !takesText(null));
});

test('who commands has a name by the kind of device', () => {
  assert.equal(deviceKind('Mozilla/5.0 (Linux; Android 14; Pixel) Mobile', 5, 400), 'Phone');
  assert.equal(deviceKind('Mozilla/5.0 (Macintosh; Intel Mac OS X)', 5, 1000), 'Tablet');
  assert.equal(deviceKind('Mozilla/5.0 (X11; Linux x86_64)', 0, 1920), 'Computer');
});

test('an explanation is terms and texts', () => {
  const page = explained('emergency-input - bit 0\n  meaning: The safety input\n           is low.\n  cause:   Pressed.\n  do:      Release.\n  next:    jtc recover');
  assert.equal(page.head, 'emergency-input - bit 0');
  assert.deepEqual(page.rows.map((row) => row.term), ['Meaning', 'Cause', 'What to do', 'Command']);
  assert.equal(page.rows[0]?.text, 'The safety input is low.');
});
