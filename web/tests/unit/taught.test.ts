import assert from 'node:assert/strict';
import { test } from 'node:test';

import { moved, type Sample, thin, waypoints } from '../../src/lib/arm/taught.ts';
import { freeNumber } from '../../src/lib/arm/numbers.ts';

const line = (n: number): Sample[] => Array.from({ length: n }, (_, i) => ({ t: i, q: [i / 10, i / 5, 0, 0, 0, 0] }));

test('a straight way is its two ends, however uneven a hand leads', () => {
  const way = line(50).map((sample, i) => ({ ...sample, t: i * i }));
  assert.deepEqual(thin(way, 0.001), [way[0], way[49]]);
});

test('a corner stays, and nothing is farther than the tolerance', () => {
  const way: Sample[] = Array.from({ length: 101 }, (_, i) => ({ t: i, q: [Math.cos(i / 30), Math.sin(i / 30), 0, 0, 0, 0] }));
  for (const tolerance of [0.001, 0.01, 0.1]) {
    const few = thin(way, tolerance);
    assert.ok(few.length < way.length);
    assert.deepEqual([few[0], few.at(-1)], [way[0], way[100]]);
    for (const sample of way) {
      const distances = few.slice(1).map((to, i) => {
        const from = few[i] as Sample;
        const steps = Array.from({ length: 201 }, (_, k) => k / 200);
        return Math.min(...steps.map((s) => Math.max(...sample.q.map((q, j) => Math.abs(q - ((from.q[j] ?? 0) + s * ((to.q[j] ?? 0) - (from.q[j] ?? 0))))))));
      });
      assert.ok(Math.min(...distances) <= tolerance + 2e-3);
    }
  }
  assert.ok(thin(way, 0.001).length > thin(way, 0.1).length);
});

test('to and fro is three points, not one', () => {
  const way = [...line(10), ...line(10).reverse()].map((sample, i) => ({ ...sample, t: i }));
  assert.equal(thin(way, 0.01).length, 3);
});

test('rest is left out; a file is what the agent reads', () => {
  assert.equal(moved([...line(2), ...line(2).slice(1), ...line(2).slice(1)]).length, 2);
  assert.equal(waypoints([[0, 1, 2, 3, 4, 5.1234567]]), 'q1,q2,q3,q4,q5,q6\n0.000000,1.000000,2.000000,3.000000,4.000000,5.123457\n');
});

test('a new trajectory takes the lowest free number', () => {
  assert.equal(freeNumber([]), 1);
  assert.equal(freeNumber([{ number: 1 }, { number: 3 }]), 2);
  assert.equal(freeNumber(Array.from({ length: 99 }, (_, i) => ({ number: i + 1 }))), 99);
});
