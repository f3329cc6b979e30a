// Test harness for the built page of an arm: an agent with a simulated arm, the agent's page, and a
// browser.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

import { chromium } from 'playwright-core';

/** Folder for the pictures that failed tests take of pages. */
const FAILED = fileURLToPath(new URL('./out/', import.meta.url));
/** Folder for the pictures of the docs. Only pictures that the docs mention are stored. */
const PICTURES = fileURLToPath(new URL('../pictures/', import.meta.url));
const SHOWN = readFileSync(new URL('../../docs/dashboard.md', import.meta.url), 'utf8');
const JTC = process.env.JTC ?? fileURLToPath(new URL('../../target/release/jtc', import.meta.url));
const CHROMIUM = process.env.CHROMIUM ?? '/usr/bin/chromium';

/** Runs `jtc` with the given arguments. Resolves to the output of `jtc`. */
export function jtc(args, options = {}) {
  return new Promise((done, fail) => {
    const child = spawn(JTC, args, options);
    let out = '';
    child.stdout.on('data', (data) => (out += data));
    child.stderr.on('data', (data) => (out += data));
    child.on('error', fail);
    child.on('close', (code) => (code === 0 ? done(out) : fail(new Error(`jtc ${args.join(' ')}: ${code}: ${out}`))));
  });
}

/**
 * Starts an agent in a new directory, with a simulated arm. With `faults`, the agent uses the port of a simulated
 * controller that has these faults.
 */
export async function startAgent({ extra = [], listen = '127.0.0.1:0', faults = undefined } = {}) {
  const dir = mkdtempSync(join(tmpdir(), 'openjtc-web-'));
  const tokenFile = join(dir, 'tokens.toml');
  const env = { ...process.env, XDG_STATE_HOME: dir };
  let link = ['--sim'];
  let sim;
  if (faults) {
    const [port, file] = [join(dir, 'port'), join(dir, 'faults.toml')];
    writeFileSync(file, faults);
    sim = spawn(JTC, ['sim', '--serial', port, '--faults', file], { cwd: dir, env });
    await until('the simulated controller is there', () => existsSync(port));
    link = ['--port', port];
  }
  let [child, gone] = [undefined, undefined];
  const begin = async (at) => {
    child = spawn(JTC, ['serve', ...link, '--listen', at, '--token-file', tokenFile, '--json', ...extra], { cwd: dir, env });
    const begun = child;
    gone = new Promise((done) => begun.once('exit', done));
    let errors = '';
    begun.stderr.on('data', (data) => (errors += data));
    const line = await new Promise((done, fail) => {
      createInterface({ input: begun.stdout }).once('line', done);
      begun.once('exit', (code) => fail(new Error(`jtc serve ended with ${code}: ${errors}`)));
    });
    return JSON.parse(line).url;
  };
  const url = await begin(listen);
  const tokens = readFileSync(tokenFile, 'utf8');
  const token = (role) => new RegExp(`${role} = "([^"]+)"`).exec(tokens)[1];
  return {
    url,
    dir,
    operator: token('operator'),
    viewer: token('viewer'),
    /** Kills the agent. The agent closes nothing, like after a power failure. */
    kill() {
      child.kill('SIGKILL');
      return gone;
    },
    /** Kills the agent and starts another agent at the same address. */
    async again() {
      child.kill('SIGKILL');
      await gone;
      await begin(new URL(url).host);
    },
    suspend: () => child.kill('SIGSTOP'),
    wake: () => child.kill('SIGCONT'),
    async end() {
      sim?.kill('SIGKILL');
      child.kill('SIGCONT');
      child.kill('SIGKILL');
      await gone;
      rmSync(dir, { recursive: true, force: true });
    },
    ask: asking(url, token('operator')),
  };
}

/**
 * Returns a function that sends requests to an agent with this token. The function resolves to status and body of the
 * answer.
 */
export function asking(url, token) {
  return async (method, path, body, key) => {
    const headers = { Authorization: `Bearer ${token}`, 'Content-Type': 'application/json' };
    if (key) headers['Lease-Key'] = key;
    const response = await fetch(url + path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body) });
    const text = await response.text();
    return { status: response.status, body: text ? JSON.parse(text) : undefined };
  };
}

const LAUNCH = {
  executablePath: CHROMIUM,
  args: [
    '--headless=new', '--no-sandbox', '--disable-gpu', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--disable-quic', '--no-first-run',
  ],
};

export function startBrowser() {
  return chromium.launch(LAUNCH);
}

/** Starts a browser that the test can kill. The killed browser simulates a tablet whose battery becomes empty. */
export async function startMortal() {
  const server = await chromium.launchServer(LAUNCH);
  return { browser: await chromium.connect(server.wsEndpoint()), kill: () => server.kill() };
}

/** Takes a picture for the docs if PICTURES is set and the docs show a picture with this name. */
export async function picture(page, name) {
  if (process.env.PICTURES && SHOWN.includes(`/${name}.png`)) await page.screenshot({ path: join(PICTURES, `${name}.png`) });
}

/** Returns an agent with its page for one test. `look` opens the page in a new browser context. */
export function stage(browser, agent) {
  const contexts = [];
  return {
    agent,
    async look({ token = 'operator', ...rest } = {}) {
      const word = token === 'none' ? '' : `#token=${agent[token] ?? token}`;
      const page = await open(browser, `${agent.url}/${word}`, rest);
      contexts.push(page.context());
      return page;
    },
    /** Takes a picture of each page, so that a developer can find the reason of a failure. */
    async picture(name) {
      for (const [i, context] of contexts.entries()) {
        for (const page of context.pages()) await page.screenshot({ path: join(FAILED, `${name}-${i}.png`), fullPage: true }).catch(() => {});
      }
    },
    async end() {
      for (const context of contexts) await context.close();
      await agent.end();
    },
  };
}

/** Defines tests. Each test has its own new agent. After a failure, the test takes a picture. */
export function staged(browser, start = startAgent) {
  return (name, options, act) =>
    test(name, async () => {
      const scene = stage(browser(), await start(options));
      try {
        await act(scene);
      } catch (error) {
        mkdirSync(FAILED, { recursive: true });
        await scene.picture(name.replace(/[^a-z0-9]+/gi, '-').slice(0, 50));
        throw error;
      } finally {
        await scene.end();
      }
    });
}

/** Returns the part of the page with the state. */
export function state(page) {
  return page.locator('section[aria-label="State"]');
}

/** Waits until the page shows that the controller holds the arm. */
export function held(page) {
  return state(page).getByText('Holding', { exact: true }).waitFor();
}

/**
 * Listens from now on for a text that the page shows for a short time. The returned function waits until the page has shown the text. The page itself notes it,
 * because the text may have disappeared before a busy browser answers.
 */
export async function says(page, pattern) {
  await page.evaluate((source) => {
    window.listening?.disconnect();
    window.heard = false;
    window.listening = new MutationObserver(() => (window.heard ||= new RegExp(source).test(document.body.textContent)));
    window.listening.observe(document.body, { subtree: true, childList: true, characterData: true });
  }, pattern.source);
  return () => page.waitForFunction(() => window.heard, undefined, { polling: 100 });
}

/** Checks that the browser has reported no errors, apart from requests that the agent refused. */
export function fine(page) {
  assert.deepEqual(page.complaints.filter((text) => !/status of 40[459]/.test(text)), []);
}

/** Recovers a controller without parameters, and selects the arm in the dialog. */
export async function recoverAs(page, arm = 'avena') {
  await state(page).getByRole('button', { name: 'Recover …' }).click();
  await page.getByRole('dialog').getByRole('button', { name: `Recover as ${arm}` }).click();
}

/**
 * Opens a page and collects the errors of the browser. With `clock`, the test can stop the time of the page, and
 * advance it with `passes`.
 */
export async function open(browser, url, { clock = false, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(120_000);
  if (clock) await page.clock.install();
  page.complaints = [];
  page.on('console', (message) => {
    if (message.type() === 'error') page.complaints.push(message.text());
  });
  page.on('pageerror', (error) => page.complaints.push(String(error)));
  await page.goto(url);
  return page;
}

/**
 * Advances the time of a page by `ms` and then stops the time, so that the page does not depend on the load of this
 * computer.
 */
export async function passes(page, ms) {
  await page.clock.pauseAt((await page.evaluate(() => Date.now())) + ms);
}

/** Waits until a condition is true in this process. The timeout is long enough for a busy computer. */
export async function until(what, condition, within = 120_000) {
  const end = Date.now() + within;
  for (;;) {
    const value = await condition();
    if (value) return value;
    if (Date.now() > end) throw new Error(`not within ${within} ms: ${what}`);
    await new Promise((done) => setTimeout(done, 50));
  }
}

/** Takes the lease as another client, and calls `act` with the key of this lease. */
export async function commanding(agent, act, name = 'test') {
  const grant = await agent.ask('POST', '/api/lease', { name, lasts_s: 60 });
  if (grant.status !== 200) throw new Error(JSON.stringify(grant));
  const key = grant.body.key;
  try {
    return await act(key);
  } finally {
    await agent.ask('DELETE', '/api/lease', undefined, key);
  }
}

export async function ended(agent, number, within = 60_000) {
  return until(`job ${number} ended`, async () => {
    const { body } = await agent.ask('GET', `/api/jobs/${number}`);
    return body.stage === 'running' ? undefined : body;
  }, within);
}

export async function recover(agent) {
  return commanding(agent, async (key) => {
    const job = await agent.ask('POST', '/api/recover', { defaults: true }, key);
    await ended(agent, job.body.number);
    // The drives are enabled shortly after the controller holds the arm.
    await until('the arm is held', async () => (await agent.ask('GET', '/api/status')).body.controller.joints.every((joint) => joint.state === 'OperationEnable'));
  });
}
