import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Api, ApiError } from '../../src/lib/api.ts';
import { Lease } from '../../src/lib/lease.ts';

type Answer = { status?: number; body?: unknown } | Error;

function setUp(answers: Answer[]) {
  const asked: { method: string; path: string; body: unknown; headers: Record<string, string> }[] = [];
  let lease: Lease | undefined;
  const api = new Api(() => 'token', () => lease?.key, async (path, init) => {
    asked.push({ method: init.method ?? '', path, body: init.body ? JSON.parse(init.body as string) : undefined, headers: init.headers as Record<string, string> });
    const answer = answers.shift() ?? {};
    if (answer instanceof Error) throw answer;
    return new Response(answer.body === undefined ? null : JSON.stringify(answer.body), { status: answer.status ?? 200 });
  });
  let changes = 0;
  lease = new Lease(api, { name: () => 'Tablet', policy: () => 'pause', changed: () => (changes += 1) });
  return { lease, asked, changes: () => changes };
}

const grant = { key: 'k1', held: true, lasts_s: 10 };

test('the first command takes it, with name, policy and duration; two at once take it once', async () => {
  const { lease, asked } = setUp([{ body: grant }]);
  await Promise.all([lease.take(), lease.take()]);
  await lease.take();
  assert.equal(asked.length, 1);
  assert.deepEqual(asked[0]?.body, { name: 'Tablet', policy: 'pause', lasts_s: 10, ask: false });
  assert.equal(lease.phase, 'held');
});

test('held by somebody else: refused with the name, and asked for on demand', async () => {
  const denied = { code: 'denied', message: 'anna has held the lease of this arm for 3 s', next: '' };
  const { lease, asked } = setUp([{ status: 409, body: denied }, { body: { ...grant, held: false } }, { body: { held: true } }]);
  await assert.rejects(lease.take(), (error: unknown) => error instanceof ApiError && error.problem.message.includes('anna'));
  assert.equal(lease.phase, 'none');
  await lease.ask();
  assert.equal(lease.phase, 'waiting');
  assert.equal(await lease.renew(), true);
  assert.equal(lease.phase, 'held');
  assert.equal(asked[2]?.headers['Lease-Key'], 'k1');
});

test('renewal shows who wants it, and notices that it is gone', async () => {
  const { lease } = setUp([{ body: grant }, { body: { held: true, wanted_by: 'bert' } }, { body: { held: false } }]);
  await lease.take();
  assert.equal(await lease.renew(), true);
  assert.equal(lease.wantedBy, 'bert');
  assert.equal(await lease.renew(), false);
  assert.equal(lease.phase, 'none');
  assert.equal(lease.key, undefined);
});

test('without an answer it may still be held; with a refusal it is not', async () => {
  const { lease } = setUp([{ body: grant }, new TypeError('network'), { status: 409, body: { code: 'denied', message: 'gone', next: '' } }]);
  await lease.take();
  assert.equal(await lease.renew(), true);
  assert.equal(await lease.renew(), false);
});

test('let go by hand; refused while a job goes on, and then still held', async () => {
  const { lease } = setUp([{ body: grant }, { status: 409, body: { code: 'busy', message: 'job 3 goes on', next: '' } }, { status: 204 }]);
  await lease.take();
  await assert.rejects(lease.release());
  assert.equal(lease.phase, 'held');
  await lease.release();
  assert.equal(lease.phase, 'none');
});
