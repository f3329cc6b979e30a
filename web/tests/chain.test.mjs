// Tests of the page of a chain: Stop, the shown data of boards, and the requests to boards.
import assert from 'node:assert/strict';
import { after, before } from 'node:test';

import AxeBuilder from '@axe-core/playwright';

import { card, EDGES, image, intelHex, sRecords, startChain } from './chain-harness.mjs';
import { passes, picture, staged, startBrowser, state, until } from './harness.mjs';

let browser;
before(async () => (browser = await startBrowser()));
after(() => browser.close());

const on = staged(() => browser, startChain);

/** Numbers the chain and runs these boards. */
async function running(agent, boards, active = false) {
  await agent.job('/api/init');
  const job = await agent.job('/api/run', { boards, active });
  assert.equal(job.stage, 'finished', JSON.stringify(job));
}

const stopWords = (page) => page.getByTestId('stop-words');
const sent = (page) => page.sent.filter(({ method, path }) => method !== 'GET' && !path.startsWith('/api/lease'));

/** Opens a page and records each of its requests. */
async function watched(look, options) {
  const page = await look(options);
  page.sent = [];
  page.on('request', (request) => page.sent.push({ method: request.method(), path: decodeURIComponent(new URL(request.url()).pathname), body: request.postData(), at: Date.now() }));
  return page;
}

on('a chain is scanned, numbered after a question, run, and stopped by one touch', { boards: 3 }, async ({ agent, look }) => {
  const page = await look();
  await state(page).getByText('No boards known').waitFor();
  await page.getByText('SIMULATED').waitFor();
  await state(page).getByRole('button', { name: 'Scan' }).click();
  await page.getByText(/No board has a number; 3 findings/).waitFor();
  await page.getByRole('button', { name: 'Number the chain …' }).click();
  await page.getByRole('dialog').getByText(/All boards on the bus are reset/).waitFor();
  assert.equal((await agent.ask('GET', '/api/boards')).body.length, 0, 'nothing is numbered before the answer');
  await page.getByRole('dialog').getByRole('button', { name: 'Reset and number' }).click();
  await card(page, 3).waitFor();
  await state(page).getByText('At rest').waitFor();
  await page.getByRole('button', { name: 'You command' }).waitFor();
  await state(page).getByRole('button', { name: 'Run' }).click();
  await page.getByRole('dialog').getByRole('switch').click();
  await page.getByRole('dialog').getByRole('button', { name: 'Run all' }).click();
  await state(page).getByText('3 boards are active').waitFor();
  await card(page, 2).getByText('Running').waitFor();
  const box = await page.getByRole('button', { name: /STOP/ }).boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.getByText(/Stopped: boards 1, 2 and 3 confirmed it\. \d+\.\d s/).waitFor();
  await page.mouse.up();
  await state(page).getByText('At rest').waitFor();
  assert.deepEqual(page.complaints, []);
});

on("the space bar stops, a viewer's too, and in a field it is a space", { boards: 2 }, async ({ agent, look }) => {
  await running(agent, [1, 2]);
  const page = await look();
  await page.getByText('Inputs', { exact: true }).waitFor();
  const field = page.getByLabel('speed_limit: value');
  await field.fill('1');
  await field.press('Space');
  assert.equal(await field.inputValue(), '1 ');
  assert.equal(await stopWords(page).count(), 0);
  await page.getByRole('button', { name: /^Theme/ }).focus();
  await page.keyboard.press('Space');
  await page.getByText(/Stopped: boards 1 and 2 confirmed it/).waitFor();
  const viewer = await look({ token: 'viewer' });
  await state(viewer).getByText('At rest').waitFor();
  await viewer.keyboard.press('Space');
  await viewer.getByText('Stop was sent. No board was running; boards 1 and 2 confirmed it.').waitFor();
});

on('boards that a page has started are stopped when it is loaded anew, and what was asked for before a Stop starts none', { boards: 2 }, async ({ agent, look }) => {
  await agent.job('/api/init');
  const page = await look();
  await state(page).getByRole('button', { name: 'Run' }).click();
  await page.getByRole('dialog').getByRole('switch').click();
  await page.getByRole('dialog').getByRole('button', { name: 'Run all' }).click();
  await state(page).getByText('2 boards are active').waitFor();
  await page.reload();
  await state(page).getByText('At rest').waitFor();
  assert.deepEqual((await agent.ask('GET', '/api/boards')).body.filter((board) => board.active), []);
  await page.getByRole('button', { name: 'Nobody commands' }).waitFor();
  // The test delays the request, so that a Stop arrives before it.
  let on;
  await page.route('**/api/run*', async (route) => {
    await new Promise((done) => (on = done));
    await route.continue();
  });
  await state(page).getByRole('button', { name: 'Run' }).click();
  await page.getByRole('dialog').getByRole('button', { name: 'Run all' }).click();
  await until('it is under way', () => on);
  await page.keyboard.press('Space');
  await page.getByTestId('stop-words').getByText(/No board was running/).waitFor();
  on();
  await page.getByRole('alert').getByText(/stopped/i).first().waitFor();
  assert.deepEqual((await agent.ask('GET', '/api/boards')).body.filter((board) => board.state === 'running'), []);
});

on('a viewer sees no command', { boards: 2 }, async ({ agent, look }) => {
  await running(agent, [1, 2], true);
  const page = await watched(look, { token: 'viewer' });
  await state(page).getByText('2 boards are active').waitFor();
  await page.getByRole('button', { name: 'Looking only' }).waitFor();
  for (const tab of ['board', 'update', 'doctor', 'jobs', 'log']) {
    await page.click(`#tab-${tab}`);
    await page.waitForTimeout(250);
    const names = await page.locator('main button:not([role=tab])').evaluateAll((all) => all.filter((each) => !each.disabled).map((each) => each.innerText.trim() || each.getAttribute('aria-label')));
    const commands = names.filter((name) => /scan|number \.|run|reset|stop|start|write|^set|update|look for|cancel/i.test(name) && !/^Board\s\d|^\d/.test(name));
    assert.deepEqual(commands, [], tab);
    assert.equal(await page.locator('#panel').getByRole('slider').and(page.locator(':enabled')).count(), 0);
  }
  assert.deepEqual(sent(page), []);
});

on('to open a page and look at everything sends nothing', { boards: 2 }, async ({ agent, look }) => {
  await running(agent, [1]);
  const page = await watched(look);
  await page.getByText('Inputs', { exact: true }).waitFor();
  for (const tab of ['update', 'doctor', 'jobs', 'log', 'board']) await page.click(`#tab-${tab}`);
  await card(page, 2).click();
  await card(page, 1).click();
  await page.waitForTimeout(1500);
  assert.deepEqual(page.sent.filter(({ method }) => method !== 'GET'), []);
  assert.deepEqual(page.sent.map(({ path }) => path).filter((path) => path.startsWith('/api/boards/2')), [], 'a board that was not started was asked');
});

on('a slider sends ten times a second at most, in the unit, and shows what was confirmed', { boards: 1, edges: EDGES.replace('PROGRAM', '0x8676') }, async ({ agent, look }) => {
  await running(agent, [1], true);
  const page = await watched(look);
  // The test uses the clock of the page, because the test may receive a request late.
  await page.evaluate(() => {
    window.puts = [];
    const own = window.fetch;
    window.fetch = (path, options) => {
      if (options?.method === 'PUT' && String(path).includes('/inputs/')) window.puts.push(performance.now());
      return own(path, options);
    };
  });
  const slider = page.getByRole('slider', { name: /set_position/ });
  await slider.scrollIntoViewIfNeeded();
  const box = await slider.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  for (let i = 1; i <= 60; i += 1) {
    await page.mouse.move(box.x + box.width / 2 + i, box.y + box.height / 2);
    await page.waitForTimeout(15);
  }
  await page.mouse.up();
  const wanted = await slider.inputValue();
  await page.waitForTimeout(800);
  const puts = sent(page);
  assert.ok(puts.length >= 3, `${puts.length} sent`);
  const times = await page.evaluate(() => window.puts);
  assert.equal(times.length, puts.length);
  for (let i = 1; i < times.length; i += 1) assert.ok(times[i] - times[i - 1] >= 99, `${times[i] - times[i - 1]} ms`);
  assert.match(puts[0].body, /^\{"value":"-?[\d.]+ deg"\}$/);
  assert.equal(JSON.parse(puts.at(-1).body).value, `${Number(wanted).toFixed(1)} deg`, 'the last value is sent, whatever was left out');
  const { inputs } = (await agent.ask('GET', '/api/boards/1/values')).body;
  await page.getByText(`confirmed ${inputs[0].text}`).waitFor();
  // Moves the slider by one step with the keyboard.
  await slider.focus();
  await slider.press('ArrowRight');
  await until('one more was sent', () => sent(page).length === puts.length + 1);
  // The board must follow the input, and the page must show the position of the board.
  await page.locator('section[aria-label="Outputs"] tr', { hasText: 'position' }).first().getByText(/[1-9]\d*\.\d\d/).waitFor();
});

on('a Stop in the middle of a movement of a slider ends it', { boards: 1 }, async ({ agent, look }) => {
  await running(agent, [1], true);
  const page = await watched(look);
  const slider = page.getByRole('slider', { name: /set_position/ });
  await slider.scrollIntoViewIfNeeded();
  const box = await slider.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  for (let i = 1; i <= 10; i += 1) await page.mouse.move(box.x + box.width / 2 + i, box.y + box.height / 2);
  await until('something was sent', () => sent(page).length > 0);
  await page.keyboard.press('Space');
  await until('Stop was sent', () => sent(page).some(({ path }) => path === '/api/stop'));
  const before = sent(page).length;
  for (let i = 1; i <= 30; i += 1) {
    await page.mouse.move(box.x + box.width / 2 - i, box.y + box.height / 2);
    await page.waitForTimeout(20);
  }
  await page.mouse.up();
  await page.waitForTimeout(400);
  assert.equal(sent(page).length, before, JSON.stringify(sent(page).slice(before)));
  await page.getByText(/Stopped: board 1 confirmed it/).waitFor();
});

on('values are plotted on a touch, parameters written, outputs switched', { boards: 1 }, async ({ agent, look }) => {
  await running(agent, [1]);
  const page = await look();
  assert.equal(await page.locator('.uplot').count(), 0);
  await page.getByRole('button', { name: 'Plot position' }).click();
  await page.locator('.uplot canvas').waitFor();
  await page.getByLabel('kp: value').fill('120');
  await page.getByRole('button', { name: 'Write kp' }).click();
  await page.locator('section[aria-label="Parameters"] tr', { hasText: 'kp' }).getByText('120').waitFor();
  await page.getByLabel('stiffness: value').fill('0x0200');
  await page.getByRole('button', { name: 'Set stiffness' }).click();
  await page.getByText('confirmed 512').waitFor();
  await page.getByRole('switch', { name: 'Outputs enabled' }).click();
  await state(page).getByText('One board is active').waitFor();
  await page.getByRole('switch', { name: 'Outputs enabled' }).click();
  await state(page).getByText('One board runs').waitFor();
  await page.getByRole('button', { name: 'Stop loop' }).click();
  await state(page).getByText('One board is started').waitFor();
  await page.getByText(/Not of now/).waitFor();
  await page.getByRole('button', { name: 'Reset …' }).click();
  await page.getByRole('dialog').getByText(/its number is gone/).waitFor();
  await page.getByRole('dialog').getByRole('button', { name: 'Leave it' }).click();
  assert.equal((await agent.board(1)).state, 'started');
  assert.deepEqual(page.complaints, []);
});

on('an update is checked, written with progress, and verified by reading back', { boards: 2 }, async ({ agent, look }) => {
  await agent.job('/api/init');
  const page = await look({ colorScheme: 'dark' });
  await page.click('#tab-update');
  await page.getByLabel('Choose a file').setInputFiles({ name: 'app.bin', mimeType: 'application/octet-stream', buffer: image(20_000) });
  await page.getByText('app.bin, 20.0 kB').waitFor();
  await page.getByRole('group', { name: 'Boards to update' }).getByRole('button', { name: 'Board 2' }).click();
  await page.getByRole('button', { name: 'Check only' }).click();
  await page.getByText('Board 2: Checks passed; nothing was written.').waitFor();
  await page.getByRole('button', { name: 'Update …' }).click();
  await page.getByRole('button', { name: 'Yes, update' }).click();
  const progress = page.getByRole('region', { name: 'Progress' });
  await progress.getByText(/Nothing has been erased yet/).waitFor();
  await progress.locator('[aria-current=step]', { hasText: 'Written' }).waitFor();
  await picture(page, 'chain-update-1400-dark');
  await page.getByText('Board 2: Verified by reading back.').waitFor({ timeout: 60_000 });
  const { program_id } = await agent.board(2);
  await card(page, 2).getByText(`0x${program_id.toString(16).toUpperCase().padStart(4, '0')}`).waitFor();
  // Starts another update and cancels this update before anything is erased.
  await page.getByLabel('Another file').setInputFiles({ name: 'other.bin', mimeType: 'application/octet-stream', buffer: image(60_000) });
  await page.getByRole('button', { name: 'Update …' }).click();
  await page.getByRole('button', { name: 'Yes, update' }).click();
  await progress.getByText(/Nothing has been erased yet/).waitFor();
  await progress.getByRole('button', { name: 'Cancel' }).click();
  await page.getByText(/Board 2: Cancelled before anything was erased/).waitFor();
  // A text file is not a valid image. The page must show the reason of the refusal.
  await page.getByLabel('Another file').setInputFiles({ name: 'notes.hex', mimeType: 'text/plain', buffer: Buffer.from('no image') });
  await page.getByRole('button', { name: 'Check only' }).click();
  await page.getByRole('alert').getByText(/./).first().waitFor();
});

on('every option of an update is sent as it was chosen, and each form of a file is read', { boards: 2 }, async ({ agent, look }) => {
  await agent.job('/api/init');
  const page = await look();
  await page.click('#tab-update');
  const asked = [];
  page.on('request', (request) => request.url().includes('/api/updates') && asked.push(JSON.parse(request.postData())));
  const bytes = image(64);
  const choose = (name, buffer) => page.getByLabel(/Choose a file|Another file/).setInputFiles({ name, mimeType: 'text/plain', buffer });
  const check = async (words) => {
    const count = asked.length;
    const button = page.getByRole('button', { name: 'Check only' });
    await until('it can be checked', () => button.isEnabled());
    // The test uses the keyboard, because a message about the last check may cover the button.
    await button.press('Enter');
    await until('it was asked', () => asked.length > count);
    await until('that is over', async () => (await agent.ask('GET', '/api/jobs')).body.every((job) => job.stage !== 'running'));
    await page.getByText(words).filter({ visible: true }).first().waitFor();
    return asked.at(-1);
  };
  await page.getByRole('group', { name: 'Boards to update' }).getByRole('button', { name: 'All' }).click();
  await page.getByText('More options').click();
  for (const [name, text] of [['app.hex', intelHex(bytes)], ['app.s19', sRecords(bytes)]]) {
    await choose(name, Buffer.from(text));
    const sent = await check('Board 1: Checks passed; nothing was written.');
    assert.deepEqual(Object.keys(sent).filter((key) => ['format', 'addresses', 'date', 'second', 'expect_program_id'].includes(key)), []);
    assert.equal(Buffer.from(sent.image, 'base64').toString(), text);
    assert.deepEqual([sent.group, sent.start, sent.dry_run, sent.force, sent.accept_unverified], [false, false, true, false, false]);
    const boards = (await agent.ask('GET', '/api/boards')).body.map(({ number, flash_number }) => ({ board: number, flash_number }));
    assert.deepEqual(sent.boards, boards);
  }
  await choose('app.txt', Buffer.from(intelHex(bytes)));
  await page.getByLabel('Form of the file').selectOption('hex');
  await page.getByLabel('Addresses count').selectOption('byte');
  await page.getByLabel(/Flash date/).fill('2026-01-02');
  await page.getByLabel(/Program ID expected/).fill('0x4B3F');
  for (const name of ['All at once, by broadcast', 'Also when boards run, or have this image already', 'Accept what cannot be verified', 'Only the boards that have these flash numbers']) await page.getByRole('switch', { name }).click();
  const sent = await check(/Checks passed|Next: /);
  assert.deepEqual([sent.format, sent.addresses, sent.date, sent.expect_program_id], ['hex', 'byte', '2026-01-02', 0x4b3f]);
  assert.deepEqual([sent.group, sent.force, sent.accept_unverified, sent.boards], [true, true, true, [{ board: 1 }, { board: 2 }]]);
  // These boards do not accept a second image. The page must report this before anything is written. The test
  // then removes the second image again.
  await page.getByLabel('Second image').setInputFiles({ name: 'data.bin', mimeType: 'application/octet-stream', buffer: bytes });
  await until('it is read', () => page.getByRole('button', { name: 'Without a second image' }).isVisible());
  assert.equal((await check(/Next: /)).second, bytes.toString('base64'));
  await page.getByRole('button', { name: 'Without a second image' }).click();
  assert.equal((await check(/Checks passed|Next: /)).second, undefined);
  // A file that was built again under the same name must be sent with its new bytes.
  await choose('app.txt', Buffer.from(intelHex(image(32))));
  assert.equal(Buffer.from((await check(/Checks passed|Next: /)).image, 'base64').toString(), intelHex(image(32)));
});

on('a doctor, jobs and events are shown', { boards: 2 }, async ({ agent, look }) => {
  await agent.job('/api/init');
  const page = await look();
  await page.click('#tab-doctor');
  await page.getByRole('button', { name: 'Look for what is wrong' }).click();
  await page.getByText(/Good:/).first().waitFor();
  await page.click('#tab-jobs');
  await page.locator('#panel').getByText('2 boards have numbers.').waitFor();
  await page.click('#tab-log');
  await page.getByText('Numbering, by test').waitFor();
});

on('a lost agent is red within two seconds, and nothing old is shown', { boards: 2 }, async ({ agent, look }) => {
  await running(agent, [1]);
  const page = await look({ clock: true });
  const value = page.locator('section[aria-label="Outputs"] td.num').first();
  await until('a value is shown', async () => /\d/.test(await value.innerText()));
  await agent.kill();
  await passes(page, 2000);
  await page.getByText('No connection', { exact: true }).first().waitFor();
  const red = await state(page).evaluate((element) => getComputedStyle(element).backgroundColor);
  assert.match(red, /rgb\((200, 16, 46|216, 33, 61)\)/);
  for (const text of await page.locator('section[aria-label="Outputs"] td.num').allInnerTexts()) assert.equal(text, '–');
  await card(page, 1).getByText('Not known').waitFor();
  await page.clock.resume();
  await page.getByRole('button', { name: /STOP/ }).click();
  await page.getByText(/STOP NOT SENT/).waitFor();
});

on('a board that falls silent is named, and values that are too old are not shown', { boards: 2, separate: true }, async ({ agent, look }) => {
  await running(agent, [1, 2]);
  const page = await look();
  await card(page, 2).click();
  await page.locator('section[aria-label="Outputs"] td.num', { hasText: /\d/ }).first().waitFor();
  agent.fault('silent board=2 for_s=30');
  await page.getByText(/Not of now/).waitFor();
  await state(page).getByText('Board 2 is lost').waitFor();
  await card(page, 2).getByText('Lost').waitFor();
  await page.keyboard.press('Space');
  await page.getByText(/NOT STOPPED: .*2/).first().waitFor();
});

on('Stop stands at one place on every tab and in dialogs', { boards: 2 }, async ({ agent, look }) => {
  await agent.job('/api/init');
  const page = await look({ viewport: { width: 800, height: 1000 } });
  await card(page, 1).waitFor();
  const places = new Set();
  const note = async (of) => {
    const { x, y } = await of.getByRole('button', { name: /STOP/ }).last().boundingBox();
    places.add(`${Math.round(x / 4)},${Math.round(y / 4)}`);
  };
  for (const tab of ['boards', 'board', 'update', 'doctor', 'jobs', 'log']) {
    await page.click(`#tab-${tab}`);
    await page.waitForTimeout(150);
    await note(page);
  }
  assert.equal(places.size, 1);
  await page.click('#tab-boards');
  await page.getByRole('button', { name: 'Number …' }).click();
  await page.getByRole('dialog').getByRole('button', { name: /STOP/ }).click();
  await page.getByText(/Stop was sent/).first().waitFor();
});

on('no width scrolls sideways, and axe finds nothing, light and dark', { boards: 3, edges: EDGES.replace('PROGRAM', '0x8676') }, async ({ agent, look }) => {
  await running(agent, [1, 2], true);
  // The result of axe depends only on the colours and on a narrow or wide page, so two runs are sufficient.
  const seen = new Set(['360 light', '1400 dark']);
  const flaws = async (page, where) => {
    if (![...seen].some((of) => where.endsWith(of))) return;
    const { violations } = await new AxeBuilder({ page }).analyze();
    assert.deepEqual(violations.map((each) => `${where}: ${each.id}: ${each.nodes.map((node) => node.html.slice(0, 160)).join(' | ')}`), []);
  };
  for (const [width, colorScheme] of [[360, 'light'], [800, 'dark'], [1400, 'light'], [1400, 'dark'], [2560, 'light']]) {
    const page = await look({ viewport: { width, height: 900 }, colorScheme });
    await state(page).getByText('2 boards are active').waitFor();
    const tabs = await page.locator('[role=tab]').evaluateAll((all) => all.map((each) => each.id));
    for (const tab of tabs) {
      await page.click(`#${tab}`);
      await page.waitForTimeout(200);
      const over = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
      assert.ok(over <= 0, `${width} ${tab}: ${over} px too wide`);
      await flaws(page, `${tab} ${width} ${colorScheme}`);
      if (tab === 'tab-board') await picture(page, `chain-boards-${width}-${colorScheme}`);
    }
    if (width < 1000) await page.click('#tab-boards');
    for (const name of ['Number …', 'Run …', 'Nobody commands']) {
      await page.getByRole('button', { name }).click();
      await page.getByRole('dialog').waitFor();
      await flaws(page, `${name} ${width} ${colorScheme}`);
      await page.keyboard.press('Escape');
      await page.getByRole('dialog').waitFor({ state: 'detached' });
    }
    await page.click('#tab-board');
    await page.getByRole('button', { name: 'Plot position' }).click();
    await page.locator('.uplot canvas').waitFor();
    await flaws(page, `plot ${width} ${colorScheme}`);
    await page.context().close();
  }
});

on('the lease is asked of who has it, and let go', { boards: 1 }, async ({ agent, look }) => {
  await agent.job('/api/init');
  const { key } = (await agent.ask('POST', '/api/lease', { name: 'Anna', lasts_s: 60 })).body;
  const page = await look();
  await page.getByText('Anna commands this chain: one client at a time.').first().waitFor();
  await page.getByRole('button', { name: 'Start', exact: true }).click();
  await page.getByRole('alert').getByText(/only one client can hold it at a time/).waitFor();
  await page.getByRole('alert').getByRole('button', { name: 'Ask for it' }).click();
  await page.getByRole('button', { name: 'Asked Anna' }).waitFor();
  await until('Anna lets it go', async () => (await agent.ask('DELETE', '/api/lease', undefined, key)).status < 300);
  await page.getByRole('button', { name: 'You command', exact: true }).click();
  await page.getByRole('dialog').getByText(/boards that it has started/).waitFor();
  await page.getByRole('dialog').getByRole('button', { name: 'Let the lease go' }).click();
  await page.getByRole('button', { name: 'Nobody commands' }).waitFor();
  assert.equal((await agent.ask('GET', '/api/status')).body.lease, undefined);
});
