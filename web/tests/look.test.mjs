// Tests of layout and accessibility of the page: each tab fits a phone and a large screen, and axe finds no fault in
// light and dark. If PICTURES is set, the tests also take the pictures of the folder pictures/.
import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before } from 'node:test';

import { AxeBuilder } from '@axe-core/playwright';

import { commanding, ended, jtc, picture, recover, staged, startBrowser, state, until } from './harness.mjs';

const TABS = ['state', 'run', 'jog', 'teach', 'arm', 'plots', 'log'];
const SIZES = [[360, 740], [800, 1180], [1400, 900]];
// The result of axe depends only on the colours and on a narrow or wide page, so two runs are sufficient.
const READ = ['360 light', '1400 dark'];
let browser;
before(async () => (browser = await startBrowser()));
after(() => browser.close());
const on = staged(() => browser);

/** All faults that a test has found so far. The test reports the faults together at its end. */
const wrong = [];
function collect(found, what) {
  wrong.push(...found.map((each) => `${what}: ${each}`));
}

function report() {
  assert.deepEqual(wrong.splice(0), []);
}

async function reads(page, what) {
  const { violations } = await new AxeBuilder({ page }).analyze();
  const found = violations.map((each) => `${each.id}: ${each.nodes.map((node) => node.target.join(' ')).slice(0, 4).join(' | ')}`);
  collect(found, what);
}

/** Checks that nothing is wider than the page, and that all controls are large enough for a touch. */
async function fits(page, what) {
  const found = await page.evaluate(() => {
    const out = [];
    if (document.documentElement.scrollWidth > innerWidth) out.push(`page ${document.documentElement.scrollWidth} px wide`);
    for (const element of document.querySelectorAll('button, select, input:not([type=file]):not([type=radio])')) {
      const { width, height } = element.getBoundingClientRect();
      if (width > 0 && !element.closest('.sr') && (height < 43.5 || width < 37.5)) out.push(`${element.textContent.trim() || element.ariaLabel || element.outerHTML.slice(0, 60)}: ${width.toFixed(0)} × ${height.toFixed(0)}`);
    }
    return out;
  });
  collect(found, what);
}

/** Prepares an arm with content for each tab: poses, a finished run, a payload. */
async function furnish(agent) {
  await recover(agent);
  await commanding(agent, async (key) => {
    await ended(agent, (await agent.ask('POST', '/api/moves', { to_rad: [0.5, -0.6, 1.1, 0.4, 0.7, 0.2] }, key)).body.number);
    await agent.ask('PUT', '/api/poses/pick', {}, key);
    await agent.ask('PUT', '/api/payload', { mass_kg: 1.2, com_m: [0, 0, 0.06] }, key);
    await ended(agent, (await agent.ask('POST', '/api/moves', { to_rad: [0.1, -0.3, 0.8, 0.1, 0.5, 0] }, key)).body.number);
    await agent.ask('PUT', '/api/poses/home', {}, key);
  });
}

for (const colorScheme of ['light', 'dark']) {
  on(`each tab can be read by everyone, ${colorScheme}`, {}, async ({ agent, look }) => {
    await furnish(agent);
    for (const [width, height] of SIZES) {
      const page = await look({ viewport: { width, height }, colorScheme });
      await state(page).getByText('Holding').waitFor();
      await until('the arm is drawn', () => page.getByTestId('view').evaluate((box) => (box.scene?.drawn ?? 0) > 0));
      for (const tab of TABS) {
        await page.click(`#tab-${tab}`);
        await page.waitForTimeout(500);
        if (READ.includes(`${width} ${colorScheme}`)) await reads(page, `${tab} at ${width} px, ${colorScheme}`);
        await fits(page, `${tab} at ${width} px, ${colorScheme}`);
        await picture(page, `${tab}-${width}-${colorScheme}`);
      }
      await page.context().close();
    }
    report();
  });
}

on('dialogs, errors and a lost connection can be read by everyone', {}, async ({ agent, look }) => {
  await furnish(agent);
  const page = await look({ viewport: { width: 800, height: 1000 } });
  await state(page).getByText('Holding').waitFor();
  await page.getByRole('button', { name: 'Nobody commands' }).click();
  await page.getByRole('dialog').waitFor();
  await reads(page, 'lease');
  await page.getByRole('button', { name: 'Token', exact: true }).click();
  await page.getByLabel('Token of this agent').waitFor();
  await reads(page, 'token');
  await page.getByRole('button', { name: 'Close' }).click();
  await commanding(agent, async () => {
    await page.click('#tab-jog');
    await page.getByRole('button', { name: 'Pump on' }).click();
    await page.getByRole('alert').waitFor();
    await reads(page, 'an error');
  }, 'anna');
  await agent.kill();
  await page.getByText('No connection', { exact: true }).first().waitFor();
  await reads(page, 'lost');
  await picture(page, 'lost-800-light');
  report();
});

on('the question which arm this is can be read by everyone', { faults: 'format = 2\n' }, async ({ look }) => {
  for (const colorScheme of ['light', 'dark']) {
    for (const [width, height] of SIZES) {
      const page = await look({ viewport: { width, height }, colorScheme });
      await state(page).getByRole('button', { name: 'Recover …' }).click();
      await page.getByRole('dialog').getByText('Is this an avena?').waitFor();
      if (READ.includes(`${width} ${colorScheme}`)) await reads(page, `which arm at ${width} px, ${colorScheme}`);
      await fits(page, `which arm at ${width} px, ${colorScheme}`);
      await picture(page, `which-arm-${width}-${colorScheme}`);
      await page.context().close();
    }
  }
  report();
});

on('a motion and its preview', {}, async ({ agent, look }) => {
  await furnish(agent);
  await jtc(['example', 'motion', '-o', agent.dir]);
  const rows = ['t,q1,q2,q3,q4,q5,q6'];
  for (let i = 0; i <= 60; i += 1) rows.push([(i * 0.033).toFixed(3), ...[1.1, 0.6, -0.9, 0.8, 0.6, -1].map((a) => (a * (1 - Math.cos((i / 60) * 2 * Math.PI)) * 0.5).toFixed(6))].join(','));
  writeFileSync(join(agent.dir, 'fast.csv'), rows.join('\n'));
  const page = await look({ colorScheme: 'dark' });
  await state(page).getByText('Holding').waitFor();
  await page.click('#tab-run');
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'fast.csv'));
  await page.getByText('Refused by the check').waitFor();
  await page.locator('#panel').getByRole('button', { name: 'Show' }).first().click();
  await page.waitForTimeout(500);
  await reads(page, 'refused');
  await picture(page, 'refused-1400-dark');
  await page.emulateMedia({ colorScheme: 'light' });
  await page.getByLabel('Trajectory file').setInputFiles(join(agent.dir, 'motion.csv'));
  await page.getByText('Passed the check').waitFor();
  await page.getByLabel('Time in the preview, s').fill('2.4');
  await page.waitForTimeout(500);
  await reads(page, 'preview');
  await picture(page, 'preview-1400-light');
  // The arm moves at a low speed, because a busy computer needs seconds for a picture.
  await page.getByLabel('Speed, % of its own').selectOption({ label: '25 %' });
  await page.getByRole('button', { name: /^Run/ }).click();
  await state(page).getByText('Moving', { exact: true }).waitFor();
  await page.waitForTimeout(4000);
  await reads(page, 'moving');
  await picture(page, 'run-1400-light');
  report();
});
