import assert from 'node:assert/strict';
import { test } from 'node:test';

import { address, Api, ApiError, problemOf } from '../../src/lib/api.ts';
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
