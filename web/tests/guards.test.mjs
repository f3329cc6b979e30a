// Tests of mistakes that the page prevents: torque with another arm's parameters, an arm drawn in a wrong pose,
// waypoints in wrong units, keys without effect.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before } from 'node:test';

import { commanding, ended, fine, held, jtc, recover, staged, startBrowser, state, until } from './harness.mjs';

let browser;
before(async () => (browser = await startBrowser()));
after(() => browser.close());
const on = staged(() => browser);

// The controller is at a serial port, like a real controller. The dialog must show the arm and the risk.
on('a controller without parameters gets none before the page has asked which arm it is', { faults: 'format = 2\n' }, async ({ agent, look }) => {
  const page = await look();
  const sent = [];
  page.on('request', (request) => {
    if (request.method() !== 'GET' && !request.url().includes('/api/lease')) sent.push(`${request.method()} ${new URL(request.url()).pathname}`);
  });
  await state(page).getByText('No torque').waitFor();
  const dialog = page.getByRole('dialog', { name: 'Which arm is this?' });
  // Tests each Recover button of the page. Neither Escape nor Enter on the element with the first focus may recover the
  // arm.
  for (const [button, key] of [[state(page).getByRole('button', { name: 'Recover …' }), 'Escape'], [page.locator('#panel').getByRole('button', { name: 'Recover …' }), 'Enter']]) {
    await button.focus();
    await page.keyboard.press('Enter');
    await dialog.getByText('Is this an avena?').waitFor();
    await dialog.getByText(/built-in masses, friction and gains under torque/).waitFor();
    assert.ok(await dialog.evaluate((element) => element.contains(document.activeElement)), 'the focus is in the dialog');
    const [one, other] = await Promise.all(['Recover as avena', 'Open an arm file'].map((name) => dialog.getByRole('button', { name }).evaluate((element) => [element.className, element.offsetHeight])));
    assert.deepEqual(one, other, 'both choices look alike');
    await page.keyboard.press(key);
    await dialog.waitFor({ state: 'detached' });
  }
  assert.deepEqual(sent, []);
  // The page must compare and send the file of another arm.
  const { text } = (await agent.ask('GET', '/api/arm')).body;
  writeFileSync(join(agent.dir, 'mine.toml'), text.replace('kp = 8000', 'kp = 7900'));
  await state(page).getByRole('button', { name: 'Recover …' }).click();
  await dialog.getByLabel('File of this arm').setInputFiles(join(agent.dir, 'mine.toml'));
  await dialog.waitFor({ state: 'detached' });
  await page.locator('#panel').getByText('mine.toml').waitFor();
  assert.deepEqual(sent, []);
  await page.getByRole('button', { name: 'Give it to the controller' }).click();
  await until('the arm is held', async () => (await agent.ask('GET', '/api/status')).body.controller.joints.every((joint) => joint.state === 'OperationEnable'));
  assert.match((await agent.ask('GET', '/api/arm')).body.text, /kp = 7900/);
  assert.ok(!sent.includes('POST /api/recover'));
  fine(page);
});

on('an arm at rest is drawn where it stands in a new theme, and when its gains are changed', {}, async ({ agent, look }) => {
  await recover(agent);
  await commanding(agent, async (key) => ended(agent, (await agent.ask('POST', '/api/moves', { to_rad: [0.14, 0.5, -1, 0.2, 0.8, 0.1] }, key)).body.number));
  const page = await look();
  await held(page);
  const posed = () => page.getByTestId('view').evaluate((box) => box.scene?.posed);
  const at = await until('the arm is drawn', async () => {
    const is = (await posed())?.measured;
    return is?.some((q) => Math.abs(q) > 0.3) ? is : undefined;
  });
  const same = async (what) => (await posed()).measured.forEach((q, i) => assert.ok(Math.abs(q - at[i]) < 0.002, `${what}: joint ${i + 1} is drawn at ${q}, stands at ${at[i]}`));
  const theme = () => page.evaluate(() => document.documentElement.dataset.theme);
  // Switches the theme to dark, to light, and to the setting of the system.
  for (const wanted of ['dark', 'light', 'light']) {
    await page.getByRole('button', { name: /^Theme/ }).click();
    await until(`the theme is ${wanted}`, async () => (await theme()) === wanted);
    await page.waitForTimeout(300);
    await same(`the theme button, ${wanted}`);
  }
  for (const colorScheme of ['dark', 'light']) {
    await page.emulateMedia({ colorScheme });
    await until(`the theme is ${colorScheme}`, async () => (await theme()) === colorScheme);
    await page.waitForTimeout(300);
    await same(`the system's theme, ${colorScheme}`);
  }
  await page.click('#tab-plots');
  await page.getByLabel(/^Kp/).fill('7000');
  await page.locator('#panel').getByRole('button', { name: 'Set', exact: true }).click();
  await until('the controller has them', async () => /kp = 7000/.test((await agent.ask('GET', '/api/arm')).body.text));
  await page.getByRole('button', { name: 'Undo' }).click();
  await until('the old ones are back', async () => !/kp = 7000/.test((await agent.ask('GET', '/api/arm')).body.text));
  await page.waitForTimeout(500);
  await same('gains');
  fine(page);
});

on('waypoints that are added are in the units of the file, and planned so', {}, async ({ agent, look }) => {
  await recover(agent);
  const to = [0.07, 0.5, -1, 0.1, 0.8, 0.1];
  await commanding(agent, async (key) => {
    await ended(agent, (await agent.ask('POST', '/api/moves', { to_rad: to }, key)).body.number);
    await agent.ask('PUT', '/api/poses/pick', {}, key);
  });
  for (const name of ['cycle', 'lines']) await jtc(['example', name, '-o', agent.dir]);
  const page = await look();
  await held(page);
  await page.click('#tab-run');
  await page.getByRole('button', { name: 'Plan', exact: true }).click();
  const text = page.getByLabel(/^Waypoints:/);
  for (const [file, button] of [['cycle-waypoints.csv', 'Add current position'], ['line-waypoints.csv', 'Add current position'], ['cycle-waypoints.csv', 'pick']]) {
    await page.getByLabel('Waypoint file').setInputFiles(join(agent.dir, file));
    await until('it is read', async () => /q1_deg/.test(await text.inputValue()));
    assert.ok(await page.getByRole('switch', { name: 'Degrees' }).isDisabled());
    await page.getByRole('button', { name: button, exact: true }).click();
    await page.getByRole('button', { name: 'Plan', exact: true }).click();
    const kept = await page.getByText(/kept as number \d/).textContent({ timeout: 120_000 });
    const { body } = await agent.ask('GET', `/api/trajectories/${/number (\d+)/.exec(kept)[1]}/points`);
    body.positions_rad.at(-1).forEach((q, i) => assert.ok(Math.abs(q - to[i]) < 0.005, `${file}, ${button}: joint ${i + 1} ends at ${q} rad, the arm stands at ${to[i]} rad`));
  }
  // A table to which the row cannot be added must stay unchanged.
  const own = 't,q1,q2,q3,q4,q5,q6,qd1\n';
  await text.fill(own);
  await page.getByRole('button', { name: 'Add current position' }).click();
  await page.getByText('Not added. The header has a column "qd1"').waitFor();
  assert.equal(await text.inputValue(), own);
  fine(page);
});

on('the jog keys are disabled while a motion is uploaded, with the reason', {}, async ({ agent, look }) => {
  await recover(agent);
  await jtc(['example', 'motion', '-o', agent.dir]);
  const page = await look();
  await held(page);
  await page.click('#tab-jog');
  const keys = page.getByRole('button', { name: /^Joint \d, / });
  await until('they are enabled', async () => (await keys.count()) === 12 && (await keys.nth(0).isEnabled()));
  // The page itself watches for the upload, because the upload is too short for the test to notice it.
  const seen = page.evaluate(() => new Promise((done) => {
    const look = () => {
      const reason = [...document.querySelectorAll('#panel .note')].map((note) => note.textContent).find((text) => /being uploaded/.test(text));
      if (reason) done([reason, [...document.querySelectorAll('#panel .key')].filter((key) => key.disabled).length]);
      else requestAnimationFrame(look);
    };
    look();
  }));
  await commanding(agent, async (key) => {
    const text = readFileSync(join(agent.dir, 'motion.csv'), 'utf8');
    await agent.ask('PUT', '/api/trajectories/1', { name: 'motion', text }, key);
    const job = (await agent.ask('POST', '/api/runs', { trajectory: 1 }, key)).body;
    assert.ok(job.number, JSON.stringify(job));
    const [reason, disabled] = await seen;
    assert.match(reason, /^A motion is being uploaded\./);
    assert.equal(disabled, 12);
    await agent.ask('POST', '/api/stop', {});
    await ended(agent, job.number);
  });
  await until('they are enabled again', () => keys.nth(0).isEnabled());
  fine(page);
});
