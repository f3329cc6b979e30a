// Tests of the use of the page: run, jog, poses, teaching, arm files, plots and gains, two users of one arm,
// errors.
import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before } from 'node:test';

import { commanding, ended, fine, held, jtc, open, recover, recoverAs, staged, startBrowser, startMortal, state, until } from './harness.mjs';

let browser;
before(async () => (browser = await startBrowser()));
after(() => browser.close());

const on = staged(() => browser);
/** True: the tests check times. Times can be checked only on a computer without other load. */
const JUDGED = process.env.FIGURES !== undefined;

const status = async (agent) => (await agent.ask('GET', '/api/status')).body;
const joints = async (agent) => (await status(agent)).controller.joints.map((joint) => joint.position_rad);
const moves = async (agent) => (await status(agent)).controller.joints.some((joint) => Math.abs(joint.velocity_rad_s) > 0.01);

/**
 * Presses a jog key again, like a user, because the page releases it after the browser was suspended for half a second.
 */
async function pressAgain(page, key) {
  if (!(await key.getAttribute('class')).includes('held')) {
    await page.mouse.up();
    await page.mouse.down();
  }
  return false;
}

async function letGo(page) {
  await page.getByRole('button', { name: 'You command' }).click();
  await page.getByRole('button', { name: 'Let the lease go' }).click();
  await page.getByRole('button', { name: 'Close' }).click();
}

on('from no torque to a held arm, and what was wrong in words', {}, async ({ look }) => {
  const page = await look();
  await state(page).getByText('No torque').waitFor();
  await state(page).getByText(/has not been given: friction, PID, arm model/).waitFor();
  await page.getByText('SIMULATED', { exact: true }).waitFor();
  await recoverAs(page);
  await held(page);
  await page.getByRole('button', { name: 'You command' }).waitFor();
  fine(page);
});

on('a file is checked, looked at, and run; the report is one touch away', {}, async ({ agent, look }) => {
  await recover(agent);
  await jtc(['example', 'motion', '-o', agent.dir]);
  const page = await look();
  await held(page);
  await page.click('#tab-run');
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'motion.csv'));
  await page.getByText('Passed the check').waitFor();
  const slider = page.getByLabel('Time in the preview, s');
  await slider.waitFor();
  const before = await joints(agent);
  await slider.fill('3');
  await until('the ghost is where the motion is at 3 s', () => page.evaluate(() => Math.abs(globalThis.arm.preview.time - 3) < 0.01));
  assert.deepEqual(await joints(agent), before, 'the preview moved the arm');
  // The speed is low until the test has paused and resumed the motion, because a busy computer needs seconds for
  // each touch.
  await page.getByLabel('Speed, % of its own').selectOption({ label: '25 %' });
  await page.getByRole('button', { name: /^Run/ }).click();
  await state(page).getByText('Moving', { exact: true }).waitFor();
  await page.getByRole('progressbar', { name: 'Progress' }).waitFor();
  await page.getByRole('button', { name: 'Pause' }).click();
  await state(page).getByText('Paused', { exact: true }).waitFor();
  assert.equal((await status(agent)).controller.trajectory, 'Pause');
  await page.getByRole('contentinfo').getByRole('button', { name: 'Resume' }).click();
  await state(page).getByText('Moving', { exact: true }).waitFor();
  await page.getByRole('slider', { name: /^Speed/ }).focus();
  await page.keyboard.press('End');
  await until('the arm moves at full speed', async () => (await agent.ask('GET', '/api/speed')).body.percent === 100);
  await page.getByText('Finished.').waitFor();
  await page.locator('#panel').getByText('Error max, mrad').waitFor();
  const [report] = await Promise.all([page.context().waitForEvent('page'), page.getByRole('button', { name: 'Report' }).click()]);
  await report.waitForURL(/\/api\/jobs\/\d+\/report/);
  fine(page);
});

on('what a check refuses is named with its joint, and shown at its place', {}, async ({ agent, look }) => {
  await recover(agent);
  const rows = ['t,q1,q2,q3,q4,q5,q6'];
  for (let i = 0; i <= 60; i += 1) rows.push([(i * 0.03).toFixed(2), ...[0.8, 0.4, -0.7, 0.8, 0.6, -1].map((a) => (a * (1 - Math.cos((i / 60) * 2 * Math.PI)) * 0.5).toFixed(6))].join(','));
  writeFileSync(join(agent.dir, 'fast.csv'), rows.join('\n'));
  const page = await look();
  await held(page);
  await page.click('#tab-run');
  // First the file is invalid, and the page must show the position of the error.
  writeFileSync(join(agent.dir, 'none.csv'), 't,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n0.1,0,0,x,0,0,0\n');
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'none.csv'));
  await page.getByRole('alert').getByText(/line 3, column 4, q3: "x" is not a number/).waitFor();
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'fast.csv'));
  await page.getByText('Refused by the check').waitFor();
  assert.ok(await page.getByRole('button', { name: /^Run/ }).isDisabled());
  await page.getByText(/Error: joint \d/).first().waitFor();
  await page.locator('#panel').getByRole('button', { name: 'Show' }).first().click();
  assert.ok((await page.evaluate(() => globalThis.arm.preview.time)) > 0);
  // The second file passes the check. Another client replaces this file before it runs.
  await jtc(['example', 'motion', '-o', agent.dir]);
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'motion.csv'));
  await page.getByText('Passed the check').waitFor();
  const { number } = (await agent.ask('GET', '/api/trajectories')).body.find((kept) => kept.name === 'motion');
  await agent.ask('PUT', `/api/trajectories/${number}`, { name: 'other', text: 't,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n' });
  await page.getByRole('button', { name: /^Run/ }).click();
  await page.getByRole('alert').filter({ hasText: 'replaced' }).waitFor();
  assert.equal((await agent.ask('GET', '/api/jobs')).body.filter((job) => job.what.startsWith('run')).length, 0);
});

on('a joint moves as long as its key is held', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.click('#tab-jog');
  const key = page.getByRole('button', { name: 'Joint 3, positive' });
  const box = await key.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await until('it moves', () => moves(agent));
  const began = (await joints(agent))[2];
  await until('it moves on while it is held', async () => {
    return (await joints(agent))[2] > began + 0.08 || (await pressAgain(page, key));
  });
  await page.mouse.up();
  await until('it rests', async () => !(await moves(agent)), 5000);
  // The test uses the keyboard. The key is released because the window loses the focus.
  await page.getByRole('button', { name: 'Joint 3, negative' }).focus();
  await page.keyboard.down('Enter');
  await until('it moves back', () => moves(agent));
  await page.evaluate(() => globalThis.dispatchEvent(new Event('blur')));
  await until('it rests again', async () => !(await moves(agent)), 5000);
  await page.keyboard.up('Enter');
  fine(page);
});

on('a jog ends with the browser', {}, async ({ agent }) => {
  await recover(agent);
  const mortal = await startMortal();
  const page = await open(mortal.browser, `${agent.url}/#token=${agent.operator}`);
  await held(page);
  await page.click('#tab-jog');
  const box = await page.getByRole('button', { name: 'Joint 1, negative' }).boundingBox();
  await page.mouse.move(box.x + 20, box.y + 20);
  await page.mouse.down();
  await until('it moves', () => moves(agent));
  await mortal.kill();
  await until('it rests', async () => !(await moves(agent)), 5000);
});

on('a key that was let go before the lease came moves nothing, nor does one that the pointer has left', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.click('#tab-jog');
  const key = page.getByRole('button', { name: 'Joint 1, negative' });
  const box = await key.boundingBox();
  const jogs = [];
  page.on('request', (request) => {
    if (request.url().includes('/api/jog') && /-?0\.\d*[1-9]/.test(request.postData())) jogs.push(request.postData());
  });
  let answer;
  await page.route('**/api/lease', async (route) => {
    await new Promise((done) => (answer = done));
    await route.continue().catch(() => {});
  });
  await page.mouse.move(box.x + 20, box.y + 20);
  await page.mouse.down();
  await until('the lease is asked for', () => answer);
  await page.mouse.up();
  answer();
  await page.getByRole('button', { name: 'You command' }).waitFor();
  await page.unrouteAll({ behavior: 'ignoreErrors' });
  await page.waitForTimeout(500);
  assert.deepEqual(jogs, []);
  await page.mouse.down();
  await until('it moves', () => moves(agent));
  await page.mouse.move(box.x + 20, box.y + 400);
  await until('it rests', async () => !(await moves(agent)), 5000);
  await page.mouse.up();
  // Presses another key directly afterwards, with the same mouse.
  const other = await page.getByRole('button', { name: 'Joint 2, positive' }).boundingBox();
  await page.mouse.move(other.x + 20, other.y + 20);
  await page.mouse.down();
  await until('it moves', () => moves(agent));
  await page.mouse.up();
  await until('it rests', async () => !(await moves(agent)), 5000);
  // If all requests arrive late, the arm must not move after the key was released.
  const before = await joints(agent);
  const late = [];
  await page.route('**/api/jog*', async (route) => {
    await new Promise((done) => setTimeout(done, 1500));
    await route.continue().catch(() => {});
    late.push(route.request());
  });
  await page.mouse.move(box.x + 20, box.y + 20);
  await page.mouse.down();
  await page.waitForTimeout(300);
  await page.mouse.up();
  await page.getByRole('alert').filter({ hasText: 'Jog' }).waitFor();
  await page.waitForTimeout(1000);
  assert.ok(late.length > 0);
  (await joints(agent)).forEach((q, i) => assert.ok(Math.abs(q - before[i]) < 0.0005, `joint ${i + 1} moved by ${q - before[i]} rad`));
});

on('a pose is saved, gone to, and removed', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.click('#tab-jog');
  await page.getByLabel('Name of the pose').fill('home');
  await page.getByRole('button', { name: 'Save where it stands' }).click();
  const row = page.locator('#panel li').filter({ hasText: 'home' });
  await row.waitFor();
  await letGo(page);
  await commanding(agent, async (key) => {
    const job = await agent.ask('POST', '/api/moves', { to_rad: [0.2, 0, 0, 0, 0, 0] }, key);
    await ended(agent, job.body.number);
  });
  await held(page);
  // Another client saves another position under this name. The arm must move to the position that this page shows.
  await commanding(agent, (key) => agent.ask('PUT', '/api/poses/home', {}, key));
  await row.getByRole('button', { name: 'Go' }).click();
  await until('it is home', async () => Math.abs((await joints(agent))[0]) < 0.002 && !(await moves(agent)));
  await page.getByRole('button', { name: 'Remove home' }).click();
  await row.getByRole('button', { name: 'Remove', exact: true }).click();
  await row.waitFor({ state: 'detached' });
  fine(page);
});

on('teaching is switched on and off; a way is recorded, thinned, planned', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.click('#tab-teach');
  await page.getByRole('button', { name: 'Teach', exact: true }).click();
  await state(page).getByText('Teaching', { exact: true }).waitFor();
  await page.locator('#panel').getByRole('button', { name: /End teaching/ }).click();
  await held(page);
  // A move replaces the simulated hand that would guide the arm.
  await page.getByRole('button', { name: 'Record', exact: true }).click();
  await letGo(page);
  await commanding(agent, async (key) => {
    for (const to of [[0.3, 0.1, 0, 0, 0, 0], [0.1, 0.3, 0.2, 0, 0, 0]]) await ended(agent, (await agent.ask('POST', '/api/moves', { to_rad: to }, key)).body.number);
  });
  await page.getByRole('button', { name: 'End recording' }).click();
  await page.getByText(/Thinned so that no joint/).waitFor();
  await page.getByRole('button', { name: 'Plan', exact: true }).click();
  await page.getByText(/kept as number \d/).waitFor({ timeout: 60_000 });
  await page.getByRole('button', { name: 'Look at it and run' }).click();
  await page.getByText(/Passed/).waitFor();
  fine(page);
});

on('an arm file is compared, and given; the payload is set', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.click('#tab-arm');
  const own = (await agent.ask('GET', '/api/arm')).body.text;
  const other = own.replace('kp = 8000', 'kp = 7900');
  writeFileSync(join(agent.dir, 'mine.toml'), other);
  await page.getByLabel('Arm file', { exact: true }).setInputFiles(join(agent.dir, 'mine.toml'));
  await page.getByText('differs at one place').waitFor();
  await page.getByText('joint 1, pid.kp').waitFor();
  await page.getByRole('button', { name: 'Give it to the controller' }).click();
  await page.getByText('the same as the controller has').waitFor();
  assert.match((await agent.ask('GET', '/api/arm')).body.text, /kp = 7900/);
  await page.getByLabel('Mass, kg').fill('1,5');
  await page.getByLabel('Centre z, mm').fill('40');
  await page.getByRole('button', { name: 'Set', exact: true }).click();
  await page.getByText(/computes with 1\.50 kg/).waitFor();
  assert.deepEqual((await agent.ask('GET', '/api/payload')).body.com_m, [0, 0, 0.04]);
  fine(page);
});

on('gains are set, tested by a step, and undone', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.click('#tab-plots');
  await page.locator('.uplot canvas').first().waitFor();
  await until('the plot has curves', () => page.evaluate(() => globalThis.arm.history.length > 20));
  // Shows each tick of the last second from the flight recorder.
  await page.getByRole('group', { name: 'Time read from the flight recorder' }).getByRole('button', { name: '1 s' }).click();
  await page.getByRole('button', { name: 'Each ms of them' }).click();
  await page.getByText(/1001 ticks of 1 ms/).waitFor({ timeout: 120_000 });
  await page.getByRole('button', { name: 'Torque' }).click();
  await page.getByRole('img', { name: /torque of joints .* 1000 a second/ }).waitFor();
  assert.ok(await page.getByRole('button', { name: 'Temperature' }).isDisabled());
  await page.getByRole('button', { name: 'Live again' }).click();
  await page.getByLabel(/^Kp/).fill('7000');
  // A value that the user types while the page reads the arm must not replace the value to set.
  let read;
  await page.route('**/api/arm', async (route) => {
    if (route.request().method() === 'GET') await new Promise((done) => (read = done));
    await route.continue().catch(() => {});
  });
  await page.locator('#panel').getByRole('button', { name: 'Set', exact: true }).click();
  await until('it is read', () => read);
  await page.getByLabel(/^Kp/).fill('3');
  read();
  await page.unrouteAll({ behavior: 'wait' });
  await until('the controller has them', async () => /kp = 7000/.test((await agent.ask('GET', '/api/arm')).body.text));
  const test = page.getByRole('button', { name: 'Test', exact: true });
  await until('it can be tested', () => test.isEnabled());
  const before = await joints(agent);
  await test.click();
  await page.locator('#panel td', { hasText: '7000' }).waitFor();
  const now = await joints(agent);
  before.forEach((q, i) => assert.ok(Math.abs(q - now[i]) < 0.002, 'it is back where it began'));
  // A Stop before the return motion must end the test of the gains.
  let second;
  await page.route('**/api/moves*', async (route) => {
    second = route.request().url();
    await route.continue().catch(() => {});
  });
  let hold = true;
  await page.route('**/api/jobs/*', async (route) => {
    while (hold) await new Promise((done) => setTimeout(done, 50));
    await route.continue().catch(() => {});
  });
  await until('it can be tested again', () => test.isEnabled());
  await test.click();
  await until('it has gone there', async () => second && Math.abs((await joints(agent))[0] - before[0]) > 0.08 && !(await moves(agent)));
  await page.keyboard.press('Space');
  await until('the Stop is counted', async () => (await status(agent)).last_halt === 1);
  await page.getByTestId('stop-words').getByText(/Stop/).waitFor();
  second = undefined;
  hold = false;
  await until('the test is over', () => test.isEnabled());
  await page.waitForTimeout(500);
  assert.equal(second, undefined, 'it went back by itself');
  await page.unrouteAll({ behavior: 'ignoreErrors' });
  await page.getByRole('button', { name: 'Undo' }).click();
  await until('the old ones are back', async () => !/kp = 7000/.test((await agent.ask('GET', '/api/arm')).body.text));
  fine(page);
});

on('two at one arm: one commands, the other asks for it and gets it', {}, async ({ agent, look }) => {
  await recover(agent);
  const [anna, bert] = [await look(), await look()];
  for (const [page, name] of [[anna, 'Anna'], [bert, 'Bert']]) {
    await page.getByRole('button', { name: 'Nobody commands' }).click();
    await page.getByLabel(/^Name that others read/).fill(name);
    await page.getByLabel(/^Name that others read/).press('Tab');
    await page.getByRole('button', { name: 'Close' }).click();
  }
  await anna.getByRole('button', { name: 'Nobody commands' }).click();
  await anna.getByRole('button', { name: 'Take the lease' }).click();
  await anna.getByRole('button', { name: 'Close' }).click();
  await bert.getByRole('button', { name: 'Anna commands' }).waitFor();
  await bert.click('#tab-jog');
  await bert.getByRole('button', { name: 'Pump on' }).click();
  const message = bert.getByRole('alert').filter({ hasText: 'Anna' });
  await message.waitFor();
  await message.getByRole('button', { name: 'Ask for it' }).click();
  await anna.getByText('Bert asks').waitFor();
  await anna.getByRole('button', { name: /You command/ }).click();
  await anna.getByRole('button', { name: 'Give it to Bert' }).click();
  await bert.getByRole('banner').getByRole('button', { name: 'You command' }).waitFor();
  // Every client can stop, with or without the lease.
  await anna.getByRole('button', { name: 'Close' }).click();
  await anna.getByRole('button', { name: /STOP/ }).click();
  await until('it was sent', async () => (await status(agent)).last_halt === 1);
});

on('an error is said with its cause, explained, and recovered from', { faults: 'format = 2\n\n[[fault]]\nkind = "node-silent"\njoint = 2\nat_point = 1500\nfor_s = 0.05\n' }, async ({ agent, look }) => {
  await recover(agent);
  await jtc(['example', 'motion', '-o', agent.dir]);
  const page = await look();
  await held(page);
  await page.click('#tab-run');
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'motion.csv'));
  await page.getByText('Passed the check').waitFor();
  await page.getByRole('button', { name: /^Run/ }).click();
  await state(page).getByText('Error', { exact: true }).waitFor({ timeout: 60_000 });
  await page.getByRole('alert').first().waitFor();
  await state(page).getByRole('button', { name: 'Explain' }).click();
  const page_ = page.getByRole('dialog');
  await page_.getByText('Meaning').waitFor();
  await page_.getByText('What to do').waitFor();
  await page.keyboard.press('Escape');
  await page.getByRole('button', { name: 'Flight recorder' }).first().waitFor();
  await state(page).getByRole('button', { name: 'Recover' }).click();
  await held(page);
  fine(page);
});

on('an agent that was started again is a new one: its events, its jobs, its Stops', { listen: '127.0.0.1:0' }, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.getByRole('button', { name: /STOP/ }).click();
  await page.getByTestId('stop-words').getByText(/Nothing was moving/).waitFor();
  await agent.again();
  await state(page).getByText('No torque').waitFor();
  await recoverAs(page);
  await held(page);
  await page.click('#tab-log');
  await page.locator('#panel').getByText(/Recover/i).first().waitFor();
  assert.equal(await page.getByText('This part of the page has failed').count(), 0);
  await page.click('#tab-jog');
  await page.mouse.move(0, 0);
  const key = page.getByRole('button', { name: 'Joint 3, positive' });
  const box = await key.boundingBox();
  await page.mouse.move(box.x + 20, box.y + 20);
  await page.mouse.down();
  await until('it moves', async () => (await moves(agent)) || (await pressAgain(page, key)));
  await page.mouse.up();
  fine(page);
});

on('an arm at rest costs little: no picture is drawn, and hardly any time is used', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await held(page);
  await page.locator('[data-testid=view]').evaluate((box) => new Promise((done) => {
    const wait = () => (box.scene ? done() : setTimeout(wait, 50));
    wait();
  }));
  await page.waitForTimeout(1500);
  const drawn = () => page.getByTestId('view').evaluate((box) => box.scene.drawn);
  const client = await page.context().newCDPSession(page);
  await client.send('Performance.enable');
  const busy = async () => (await client.send('Performance.getMetrics')).metrics.find((metric) => metric.name === 'TaskDuration').value;
  const [pictures, time] = [await drawn(), await busy()];
  await page.waitForTimeout(4000);
  const share = ((await busy()) - time) / 4;
  assert.equal((await drawn()) - pictures, 0);
  if (JUDGED) assert.ok(share < 0.1, `${(share * 100).toFixed(1)} % of a core`);
  console.log(`idle: ${(share * 100).toFixed(1)} % of a core`);
});

on('the first paint is timed', {}, async ({ look }) => {
  const page = await look();
  const first = await until('something is painted', () => page.evaluate(() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime));
  if (JUDGED) assert.ok(first < 1000, `${first} ms`);
  console.log(`first paint: ${Math.round(first)} ms`);
});

on('nothing is asked of anybody else', {}, async ({ agent, look }) => {
  const page = await look();
  const others = [];
  page.on('request', (request) => {
    if (!request.url().startsWith(agent.url) && !request.url().startsWith('blob:') && !request.url().startsWith('data:')) others.push(request.url());
  });
  await page.reload();
  for (const tab of ['run', 'jog', 'teach', 'arm', 'plots', 'log']) {
    await page.click(`#tab-${tab}`);
    await page.waitForTimeout(200);
  }
  assert.deepEqual(others, []);
});
