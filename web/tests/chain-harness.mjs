// Test harness for the page of a chain: an agent with simulated boards, the agent's page, and a
// browser.
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { fileURLToPath } from 'node:url';

import { asking, ended, until } from './harness.mjs';

const UCOM = process.env.UCOM ?? fileURLToPath(new URL('../../target/release/ucom', import.meta.url));

function firstLine(child, name) {
  let errors = '';
  child.stderr.on('data', (data) => (errors += data));
  return new Promise((done, fail) => {
    createInterface({ input: child.stdout }).once('line', done);
    child.once('exit', (code) => fail(new Error(`${name} ended with ${code}: ${errors}`)));
  });
}

/**
 * Starts an agent in a new directory, with `boards` simulated boards. `edges` is a signal table. With `separate`, the boards run in a separate
 * process, which accepts faults through `fault`.
 */
export async function startChain({ boards = 3, edges = undefined, separate = false } = {}) {
  const dir = mkdtempSync(join(tmpdir(), 'openjtc-chain-'));
  const tokenFile = join(dir, 'tokens.toml');
  const env = { ...process.env, XDG_STATE_HOME: dir, XDG_CACHE_HOME: dir };
  let bus = ['--sim', '--boards', String(boards)];
  let sim;
  if (separate) {
    sim = spawn(UCOM, ['sim', '--boards', String(boards), '--listen', '127.0.0.1:0', '--json'], { cwd: dir, env });
    const ready = await firstLine(sim, 'ucom sim');
    bus = ['--bus', /socketcand:[^"\s]+/.exec(ready)[0]];
  }
  if (edges) writeFileSync(join(dir, 'ucom-edges.toml'), edges);
  const child = spawn(UCOM, ['serve', ...bus, '--listen', '127.0.0.1:0', '--token-file', tokenFile, '--json'], { cwd: dir, env });
  const { url } = JSON.parse(await firstLine(child, 'ucom serve'));
  await until('there are tokens', () => existsSync(tokenFile));
  const tokens = readFileSync(tokenFile, 'utf8');
  const token = (role) => new RegExp(`${role} = "([^"]+)"`).exec(tokens)[1];
  const gone = new Promise((done) => child.once('exit', done));
  const agent = {
    url,
    dir,
    operator: token('operator'),
    viewer: token('viewer'),
    kill() {
      child.kill('SIGKILL');
      return gone;
    },
    fault: (line) => sim.stdin.write(`${line}\n`),
    async end() {
      child.kill('SIGKILL');
      sim?.kill('SIGKILL');
      await gone;
      rmSync(dir, { recursive: true, force: true });
    },
    ask: asking(url, token('operator')),
    /**
     * Runs a job as another client, which releases the lease after the job. Boards that the job has started continue to
     * run.
     */
    async job(path, body = {}) {
      const grant = await agent.ask('POST', '/api/lease', { name: 'test', policy: 'continue', lasts_s: 60 });
      const { key } = grant.body;
      const begun = await agent.ask('POST', path, body, key);
      const job = await ended(agent, begun.body.number);
      await until('the lease is free', async () => (await agent.ask('DELETE', '/api/lease', undefined, key)).status !== 409);
      return job;
    },
    board: async (number) => (await agent.ask('GET', `/api/boards/${number}`)).body,
  };
  return agent;
}

export const card = (page, number) => page.getByRole('button', { name: new RegExp(`^Board ${number} `) });

/** Returns an image for an update. A simulated board accepts any bytes as a program. */
export function image(bytes) {
  return Buffer.from(Array.from({ length: bytes }, (_, i) => (37 * i + 11) & 0xff));
}

const hex = (bytes) => Buffer.from(bytes).toString('hex').toUpperCase();
const sum = (bytes) => bytes.reduce((a, b) => a + b, 0) & 0xff;

/** Returns the bytes, which begin at address 0, as Intel HEX with 16 bytes per record. */
export function intelHex(bytes) {
  const record = (address, kind, data) => {
    const all = [data.length, address >> 8, address & 0xff, kind, ...data];
    return `:${hex([...all, -sum(all) & 0xff])}\n`;
  };
  let text = '';
  for (let at = 0; at < bytes.length; at += 16) text += record(at, 0, bytes.subarray(at, at + 16));
  return `${text}:00000001FF\n`;
}

/** Like `intelHex`, but returns Motorola S-records. */
export function sRecords(bytes) {
  const record = (kind, address, data) => {
    const all = [data.length + 3, address >> 8, address & 0xff, ...data];
    return `S${kind}${hex([...all, ~sum(all) & 0xff])}\n`;
  };
  let text = record(0, 0, Buffer.from('app'));
  for (let at = 0; at < bytes.length; at += 16) text += record(1, at, bytes.subarray(at, at + 16));
  return `${text}${record(9, 0, [])}`;
}

export const EDGES = `[[program]]
program_id = PROGRAM
name = "neck"
[program.ci]
set_position = { scale = 0.01, unit = "deg", min = -60, max = 60 }
stiffness = { scale = 0.1, unit = "%", min = 0, max = 100 }
[program.so]
position = { scale = 0.01, unit = "deg" }
velocity = { scale = 0.1, unit = "deg/s" }
current = { unit = "mA" }
temperature = { scale = 0.1, unit = "°C" }
reference = { scale = 0.01, unit = "deg" }
`;
