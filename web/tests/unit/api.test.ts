import assert from 'node:assert/strict';
import { test } from 'node:test';

import { address, Api, ApiError, OPEN_MAX, problemOf } from '../../src/lib/api.ts';
import { Lateness } from '../../src/lib/lateness.ts';
import { guarded } from '../../src/lib/storage.ts';
import { tokenIn, TokenStore } from '../../src/lib/token.ts';

function answering(status: number, text: string) {
  const sent: RequestInit[] = [];
  const api = new Api(() => 'T', () => 'K', async (_, init) => {
    sent.push(init);
    return new Response(status === 204 ? null : text, { status });
  });
  return { api, sent };
}

test('token with everything, key with commands alone', async () => {
  const { api, sent } = answering(200, '{}');
  await api.get('/api/status');
  await api.json('POST', '/api/jog', { body: { rates_rad_s: [] } });
  const [get, post] = sent.map((init) => init.headers as Record<string, string>);
  assert.deepEqual(get, { Authorization: 'Bearer T' });
  assert.deepEqual(post, { Authorization: 'Bearer T', 'Lease-Key': 'K', 'Content-Type': 'application/json' });
});

test('what is refused says message, cause and what helps', async () => {
  const { api } = answering(409, JSON.stringify({ code: 'refused', message: 'too fast', next: 'slower', joint: 3 }));
  await assert.rejects(api.get('/api/x'), (error: unknown) => {
    assert.ok(error instanceof ApiError);
    assert.equal(error.problem.joint, 3);
    assert.equal(error.problem.next, 'slower');
    return !error.isMissingPath;
  });
});

test('a path that the agent does not have is distinguished from a number that it does not have', () => {
  assert.ok(new ApiError(404, problemOf(404, '')).isMissingPath);
  assert.ok(new ApiError(405, problemOf(405, '')).isMissingPath);
  assert.ok(!new ApiError(404, problemOf(404, '{"code":"not-found","message":"no job 9","next":""}')).isMissingPath);
});

test('no network is an error with a cause', async () => {
  const api = new Api(() => undefined, () => undefined, () => Promise.reject(new TypeError('failed to fetch')));
  await assert.rejects(api.get('/api/status'), (error: unknown) => error instanceof ApiError && error.isNoConnection && error.problem.cause !== undefined);
});

test('addresses leave out what is not known', () => {
  assert.equal(address('/a', { asked_after: undefined }), '/a');
  assert.equal(address('/a', { asked_after: 3, n: 'x y' }), '/a?asked_after=3&n=x%20y');
});

test('the token in the fragment is taken out of it', () => {
  assert.deepEqual(tokenIn('#token=ab_c-d&x=1'), { token: 'ab_c-d', rest: '#x=1' });
  assert.deepEqual(tokenIn('#token=abc'), { token: 'abc', rest: '' });
  assert.deepEqual(tokenIn(''), { token: undefined, rest: '' });
  assert.deepEqual(tokenIn('#token=%E0%A4%A'), { token: '%E0%A4%A', rest: '' });
});

test('a token is remembered where it was asked for, and only there', () => {
  const memory = () => {
    const map = new Map<string, string>();
    return { getItem: (n: string) => map.get(n) ?? null, setItem: (n: string, v: string) => void map.set(n, v), removeItem: (n: string) => void map.delete(n) };
  };
  const [session, device] = [memory(), memory()];
  const store = new TokenStore(session, device);
  store.set('a', false);
  assert.equal(new TokenStore(memory(), device).get(), undefined);
  store.set('b', true);
  assert.equal(new TokenStore(memory(), device).get(), 'b');
  store.forget();
  assert.equal(store.get(), undefined);
});

test('so many requests are open at once, a Stop beside them, and commands that wait are dropped by it', async () => {
  const open: { path: string; answer: () => void }[] = [];
  const api = new Api(() => undefined, () => undefined, (path) => new Promise((done) => open.push({ path, answer: () => done(new Response('{}')) })));
  const reads = Array.from({ length: OPEN_MAX + 1 }, (_, i) => api.get(`/read/${i}`));
  const command = api.json('POST', '/command');
  void api.json('POST', '/stop', { ahead: true });
  await Promise.resolve();
  assert.deepEqual(open.map(({ path }) => path), [...Array.from({ length: OPEN_MAX }, (_, i) => `/read/${i}`), '/stop']);
  api.recall('A Stop came before it was sent');
  await assert.rejects(command, (error: unknown) => error instanceof ApiError && error.problem.code === 'not-sent');
  for (let i = 0; i <= OPEN_MAX + 1; i += 1) {
    open[i]?.answer();
    await new Promise((done) => setImmediate(done));
  }
  await Promise.all(reads);
  assert.equal(open.at(-1)?.path, `/read/${OPEN_MAX}`);
  // All connections are free again.
  const more = Array.from({ length: OPEN_MAX }, () => api.get('/more'));
  await new Promise((done) => setImmediate(done));
  for (const each of open.filter(({ path }) => path === '/more')) each.answer();
  assert.equal((await Promise.all(more)).length, OPEN_MAX);
});

test('messages that all come late are as late as they are, beside the soonest', () => {
  const lateness = new Lateness();
  assert.equal(lateness.agentTime(0), undefined);
  // The agent started 500 ms after this page. Most messages of the agent take 20 ms, then one takes 45 ms, and
  // one takes 3 s.
  assert.equal(lateness.take(0, 520), 0);
  assert.equal(lateness.take(1000, 1545), 25);
  assert.equal(lateness.take(2000, 5500), 2980);
  assert.equal(lateness.agentTime(6520), 6000);
  // A clock that is slower by 100 ppm must not count as a delay, because old messages are not used.
  let [most, now] = [0, 10_000];
  const slow = new Lateness();
  for (let i = 0; i < 4000; i += 1, now += 5000) most = Math.max(most, slow.take(now * (1 - 1e-4), now));
  assert.ok(most < 100, `${most} ms`);
  lateness.forget();
  assert.equal(lateness.agentTime(0), undefined);
});

test('a delay that all messages have is seen by what is asked, and clocks that stood still are no delay', () => {
  // The agent and the page have the same clock, and every message takes 3 s.
  const late = new Lateness();
  for (let now = 10_000; now < 40_000; now += 500) {
    const found = late.take(now - 3000, now);
    if (now % 5000 === 0) late.probe(now - 6000, now - 3000);
    if (now >= 21_000) assert.equal(found, 6000, `${now}`);
  }
  // Messages take 10 ms in each direction, and one request waits for a second.
  const good = new Lateness();
  for (let now = 10_000; now < 60_000; now += 500) {
    const found = good.take(now - 10, now);
    if (now % 5000 === 0) good.probe(now - (now === 30_000 ? 1020 : 20), now - 10);
    assert.ok(found <= 20, `${now}: ${found}`);
  }
  // First the agent's computer is suspended for a minute, and later this computer.
  for (const slept of [60_000, -60_000]) {
    for (let now = 60_000; now < 90_000; now += 500) {
      good.take(now - 10 - slept, now);
      if (now % 5000 === 0) good.probe(now - 20, now - 10 - slept);
    }
    assert.ok(good.take(90_000 - 10 - slept, 90_000) <= 20);
    assert.ok(Math.abs((good.agentTime(90_000) ?? 0) - (90_000 - slept)) <= 20);
  }
});

test('a browser that keeps nothing is a page that forgets', () => {
  const store = guarded(() => {
    throw new DOMException('denied', 'SecurityError');
  });
  assert.equal(store.getItem('a'), null);
  store.setItem('a', '1');
  assert.equal(store.getItem('a'), '1');
  store.removeItem('a');
  assert.equal(store.getItem('a'), null);
});
