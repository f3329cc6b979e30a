// Tests of Stop and of the messages about an unknown state. Stop and the messages are the most
// important parts of the page.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before } from 'node:test';

import { commanding, jtc, passes, recover, says, staged, startBrowser, state, until } from './harness.mjs';

let browser;
before(async () => (browser = await startBrowser()));
after(() => browser.close());

const on = staged(() => browser);

/**
 * Starts a motion of half a minute as another client, and calls `act` during the motion. The motion is long enough even
 * on a busy computer.
 */
async function moving(agent, act) {
  await jtc(['example', 'motion', '-o', agent.dir]);
  const text = readFileSync(join(agent.dir, 'motion.csv'), 'utf8');
  await commanding(agent, async (key) => {
    await agent.ask('PUT', '/api/trajectories/1', { name: 'motion', text }, key);
    const run = await agent.ask('POST', '/api/runs', { trajectory: 1, approach: true, speed_percent: 20 }, key);
    assert.equal(run.status, 202);
    await until('it moves', async () => {
      const { controller } = (await agent.ask('GET', '/api/status')).body;
      return controller.trajectory === 'Execute' && controller.point > 800;
    });
    await act();
    await until('it has stopped', async () => (await agent.ask('GET', `/api/jobs/${run.body.number}`)).body.stage !== 'running');
  });
}

on('Stop by one touch ends a motion, and says what it did', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await state(page).getByText('Holding').waitFor();
  await moving(agent, async () => {
    await state(page).getByText('Moving').waitFor();
    // Stop must act when the button is pressed, before it is released.
    const box = await page.getByRole('button', { name: /STOP/ }).boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    const said = await says(page, /Stopped on the path in \d\.\d s; the arm is held/);
    await page.mouse.down();
    await said();
    await page.mouse.up();
  });
  await state(page).getByText('Holding').waitFor();
  assert.deepEqual(page.complaints.filter((text) => !/40[45]/.test(text)), []);
});

on('the space bar stops, also with a button in focus, and in a field it is a space', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await page.click('#tab-jog');
  const field = page.getByLabel('Name of the pose');
  await field.waitFor();
  await field.fill('a');
  await field.press('Space');
  assert.equal(await field.inputValue(), 'a ');
  assert.equal((await agent.ask('GET', '/api/status')).body.last_halt, 0);
  await moving(agent, async () => {
    await page.getByRole('button', { name: /^Theme/ }).focus();
    const before = await page.evaluate(() => document.documentElement.dataset.theme);
    const said = await says(page, /Stopped on the path/);
    await page.keyboard.press('Space');
    await said();
    assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), before, 'the button in focus was pressed, too');
  });
  const said = await says(page, /Nothing was moving; the arm is held/);
  await page.keyboard.press('Space');
  await said();
});

on('a dialog leaves Stop where it is', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  const stop = page.getByRole('button', { name: /STOP/ });
  const outside = await stop.boundingBox();
  await page.getByRole('button', { name: /commands/ }).click();
  await page.getByRole('dialog').waitFor();
  const inside = await page.getByRole('dialog').getByRole('button', { name: /STOP/ }).boundingBox();
  assert.ok(Math.abs(inside.x - outside.x) < 3 && Math.abs(inside.y - outside.y) < 3, JSON.stringify({ inside, outside }));
  await page.getByRole('dialog').getByRole('button', { name: /STOP/ }).click();
  await until('it was sent once', async () => (await agent.ask('GET', '/api/status')).body.last_halt === 1);
});

on('Stop stands at one place on every tab', {}, async ({ look }) => {
  const page = await look({ viewport: { width: 800, height: 1000 } });
  const places = new Set();
  for (const tab of ['state', 'run', 'jog', 'teach', 'arm', 'plots', 'log']) {
    await page.click(`#tab-${tab}`);
    await page.waitForTimeout(150);
    const { x, y } = await page.getByRole('button', { name: /STOP/ }).boundingBox();
    places.add(`${x},${y}`);
  }
  assert.equal(places.size, 1);
});

on("a viewer sees no command, and Stop works", {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look({ token: 'viewer' });
  await state(page).getByText('Holding').waitFor();
  await page.getByRole('button', { name: 'Looking only' }).waitFor();
  for (const [tab, command] of [['jog', 'Joint 1, positive'], ['teach', 'Teach'], ['run', 'Open a file'], ['state', 'Recover'], ['plots', 'Set'], ['arm', 'Set']]) {
    await page.click(`#tab-${tab}`);
    await page.waitForTimeout(200);
    assert.equal(await page.locator('#panel').getByRole('button', { name: command, exact: true }).count(), 0, `${tab}: ${command}`);
  }
  await moving(agent, async () => {
    const said = await says(page, /Stopped on the path/);
    await page.getByRole('button', { name: /STOP/ }).click();
    await said();
  });
});

on('a lost agent is red within two seconds, and nothing old is shown', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look({ clock: true });
  await state(page).getByText('Holding').waitFor();
  const position = page.locator('.bars .joint .value').first();
  await until('a position is shown', async () => /\d/.test(await position.innerText()));
  await agent.kill();
  await passes(page, 2000);
  await page.getByText('No connection', { exact: true }).first().waitFor();
  const red = await state(page).evaluate((element) => getComputedStyle(element).backgroundColor);
  assert.match(red, /rgb\((200, 16, 46|216, 33, 61)\)/);
  await page.getByText('Not the arm as it is now').waitFor();
  for (const text of await page.locator('.bars .joint .value').allInnerTexts()) assert.match(text, /^[^\d]*–/, text);
  await page.clock.resume();
  await page.getByRole('button', { name: /STOP/ }).click();
  await page.getByText(/STOP NOT SENT/).waitFor();
});

on('an agent that hangs is noticed as well, and comes back by itself', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look({ clock: true });
  await state(page).getByText('Holding').waitFor();
  // The first drawing keeps a computer without graphics hardware busy for a while.
  await until('the arm is drawn', () => page.getByTestId('view').evaluate((box) => (box.scene?.drawn ?? 0) > 0));
  await jtc(['example', 'motion', '-o', agent.dir]);
  await page.click('#tab-run');
  const file = await page.getByLabel('Trajectory file').elementHandle();
  agent.suspend();
  await passes(page, 2000);
  await page.getByText('No connection', { exact: true }).first().waitFor();
  // A file dialog may stay open longer than this loss of the connection.
  await file.setInputFiles(join(agent.dir, 'motion.csv'));
  agent.wake();
  await page.clock.resume();
  await state(page).getByText('Holding').waitFor();
  await page.getByText('Passed the check').waitFor();
  await until('positions are shown', async () => /\d/.test(await page.locator('.bars .joint .value').first().innerText()));
});

on('a wrong token is said to be wrong, and a right one lets in', {}, async ({ agent, look }) => {
  const page = await look({ token: 'wrong-wrong-wrong-wrong' });
  await page.getByRole('dialog').getByText(/not accepted/).waitFor();
  assert.equal(new URL(page.url()).hash, '', 'the token stays in the address');
  await page.getByLabel('Token of this agent').fill(agent.operator);
  await page.getByRole('button', { name: 'Use this token' }).click();
  await state(page).getByText('No torque').waitFor();
  await page.getByRole('button', { name: 'Nobody commands' }).waitFor();
  assert.equal(await page.evaluate(() => localStorage.getItem('openjtc-token')), null);
  await page.reload();
  await page.getByRole('button', { name: 'Nobody commands' }).waitFor();
});

on('a Stop that nobody confirms says so, at once and as often as it is touched', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await state(page).getByText('Holding').waitFor();
  const words = page.getByTestId('stop-words');
  // Loads the parts of the page that the test needs later.
  await page.getByRole('button', { name: 'Nobody commands' }).click();
  await page.getByRole('button', { name: 'Close' }).click();
  // When the next Stop begins, the page still shows the message of this first Stop.
  await page.getByRole('button', { name: /STOP/ }).click();
  await words.getByText(/Nothing was moving/).waitFor();
  const seen = await page.evaluate(() => {
    const seen = [];
    new MutationObserver(() => seen.push(document.querySelector('[data-testid=stop-words]')?.innerText ?? '')).observe(document.body, { subtree: true, childList: true, characterData: true });
    globalThis.seen = seen;
  });
  assert.equal(seen, undefined);
  agent.suspend();
  await page.getByRole('button', { name: /STOP/ }).click();
  await page.waitForTimeout(500);
  await page.getByRole('button', { name: /STOP/ }).click();
  await words.getByText(/STOP NOT CONFIRMED\. Use the emergency stop/).waitFor();
  await words.getByText(/STOP NOT SENT\. Use the emergency stop/).waitFor();
  await page.waitForTimeout(3000);
  assert.match(await words.innerText(), /STOP NOT SENT/);
  const texts = [...new Set(await page.evaluate(() => globalThis.seen))];
  assert.deepEqual(texts.filter((text) => !/NOT CONFIRMED|NOT SENT|being sent|Nothing was moving/.test(text)), []);
  // A dialog must show the message next to its own Stop button.
  await page.getByRole('button', { name: 'Not known' }).click();
  await page.getByRole('dialog').getByRole('alert').getByText(/STOP NOT SENT/).waitFor();
  agent.wake();
  await state(page).getByText('Holding').waitFor();
});

on('Pause touched twice is a pause', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look();
  await state(page).getByText('Holding').waitFor();
  await jtc(['example', 'motion', '-o', agent.dir]);
  await page.click('#tab-run');
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'motion.csv'));
  await page.getByText('Passed the check').waitFor();
  await page.getByLabel('Speed, % of its own').selectOption({ label: '25 %' });
  await page.getByRole('button', { name: /^Run/ }).click();
  await state(page).getByText('Moving', { exact: true }).waitFor();
  const box = await page.getByRole('button', { name: 'Pause' }).boundingBox();
  for (let i = 0; i < 4; i += 1) {
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await page.waitForTimeout(400);
  }
  await state(page).getByText('Paused', { exact: true }).waitFor();
  assert.equal((await agent.ask('GET', '/api/status')).body.controller.trajectory, 'Pause');
  // The message must be complete and visible in addition to the errors.
  await page.setViewportSize({ width: 360, height: 740 });
  const [toasts, dock] = await Promise.all([page.getByRole('region', { name: 'Messages' }).boundingBox(), page.locator('footer').boundingBox()]);
  assert.ok(toasts.y + toasts.height <= dock.y, JSON.stringify({ toasts, dock }));
});

on('an address with a token that is none shows the page all the same', {}, async ({ agent, look }) => {
  await recover(agent);
  const page = await look({ token: '%E0%A4%A' });
  await page.getByRole('dialog').getByText(/not accepted/).waitFor();
  // On the agent's own computer a Stop needs no token, and a wrong token must not prevent the Stop.
  await page.getByRole('dialog').getByRole('button', { name: /STOP/ }).click();
  await until('it was sent', async () => (await agent.ask('GET', '/api/status')).body.last_halt === 1);
});
