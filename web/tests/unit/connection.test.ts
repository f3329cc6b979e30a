import assert from 'node:assert/strict';
import { test } from 'node:test';

import { type BaseStatus, Connection, type EventsMessage, type Phase, SILENT_MS, type Socket, type Surroundings } from '../../src/lib/connection.ts';

class FakeSocket implements Socket {
  onopen: Socket['onopen'] = null;
  onmessage: Socket['onmessage'] = null;
  onclose: Socket['onclose'] = null;
  onerror: Socket['onerror'] = null;
  closed = false;
  readonly path: string;
  readonly protocols: string[];
  constructor(path: string, protocols: string[]) {
    this.path = path;
    this.protocols = protocols;
  }
  close(): void {
    this.closed = true;
  }
  opens(): void {
    this.onopen?.(undefined as never);
  }
  gives(message: object): void {
    this.onmessage?.({ data: JSON.stringify(message) });
  }
  drops(): void {
    this.onclose?.(undefined as never);
  }
}

/** Clock that the test advances. */
class World implements Surroundings {
  time = 0;
  sockets: FakeSocket[] = [];
  #due = new Map<number, { at: number; act: () => void }>();
  #next = 1;
  open(path: string, protocols: string[]): Socket {
    const socket = new FakeSocket(path, protocols);
    this.sockets.push(socket);
    return socket;
  }
  now(): number {
    return this.time;
  }
  later(act: () => void, ms: number): unknown {
    this.#next += 1;
    this.#due.set(this.#next, { at: this.time + ms, act });
    return this.#next;
  }
  never(handle: unknown): void {
    this.#due.delete(handle as number);
  }
  passes(ms: number): void {
    const end = this.time + ms;
    for (;;) {
      const first = [...this.#due].filter(([, due]) => due.at <= end).sort((a, b) => a[1].at - b[1].at)[0];
      if (!first) break;
      this.#due.delete(first[0]);
      this.time = first[1].at;
      first[1].act();
    }
    this.time = end;
  }
  get last(): FakeSocket {
    return this.sockets.at(-1) as FakeSocket;
  }
}

function setUp(token?: string) {
  const world = new World();
  const seen = { statuses: [] as BaseStatus[], events: [] as EventsMessage[], phases: [] as Phase[], refused: 0 };
  const connection = new Connection(
    world,
    { status: (s) => seen.statuses.push(s), events: (e) => seen.events.push(e), phase: (p) => seen.phases.push(p), refused: () => (seen.refused += 1) },
    () => token,
  );
  connection.start();
  return { world, seen, connection };
}

const status = (agent = 'a') => ({ kind: 'status', agent, last_event: 5 });
const events = (last: number, agent = 'a') => ({ kind: 'events', agent, last, missed: false, events: [{ number: last, unix_s: 0 }] });

test('the token goes as a protocol, and not in the address', () => {
  const { world } = setUp('secret');
  assert.deepEqual(world.last.protocols, ['openjtc', 'bearer.secret']);
  assert.ok(!world.last.path.includes('secret'));
  assert.deepEqual(setUp().world.last.protocols, ['openjtc']);
});

test('after a lost connection it asks on from the last event', () => {
  const { world, seen } = setUp();
  assert.equal(world.last.path, '/api/stream?after=0');
  world.last.opens();
  world.last.gives(events(7));
  world.last.drops();
  assert.equal(seen.phases.at(-1), 'waiting');
  world.passes(250);
  assert.equal(world.last.path, '/api/stream?after=7');
});

test('another agent is asked from the beginning', () => {
  const { world } = setUp();
  world.last.opens();
  world.last.gives(events(7));
  world.last.drops();
  world.passes(250);
  world.last.opens();
  world.last.gives(status('b'));
  world.passes(10);
  assert.equal(world.last.path, '/api/stream?after=0');
});

test('silence is no connection, and closes what is silent for long', () => {
  const { world, connection } = setUp();
  world.last.opens();
  world.last.gives(status());
  assert.ok(connection.isLive);
  world.passes(SILENT_MS - 1);
  assert.ok(connection.isLive);
  world.passes(2);
  assert.ok(!connection.isLive);
  const silent = world.last;
  world.passes(2 * SILENT_MS);
  connection.check();
  assert.ok(silent.closed);
  world.passes(300);
  assert.notEqual(world.last, silent);
});

test('it waits longer from attempt to attempt, 2 s at most, and says each time that it was refused', () => {
  const { world, seen } = setUp();
  const times: number[] = [];
  for (let i = 0; i < 7; i += 1) {
    const before = world.sockets.length;
    world.last.drops();
    while (world.sockets.length === before) world.passes(50);
    times.push(world.time);
  }
  const gaps = times.map((time, i) => time - (times[i - 1] ?? 0));
  assert.ok((gaps[1] ?? 0) > (gaps[0] ?? 0));
  assert.ok(gaps.every((gap) => gap <= 2050));
  assert.equal(seen.refused, 7);
});

test('a socket that never opens is given up', () => {
  const { world } = setUp();
  world.passes(4000);
  assert.ok(world.sockets[0]?.closed);
  world.passes(300);
  assert.equal(world.sockets.length, 2);
});

test('a message begins the waits anew; hurry does not wait', () => {
  const { world, connection } = setUp();
  for (let i = 0; i < 5; i += 1) {
    world.last.drops();
    world.passes(2100);
  }
  world.last.opens();
  world.last.gives(status());
  world.last.drops();
  const before = world.sockets.length;
  world.passes(250);
  assert.equal(world.sockets.length, before + 1);
  for (let i = 0; i < 4; i += 1) {
    world.last.drops();
    connection.hurry();
  }
  assert.equal(world.sockets.length, before + 5);
});

test('what is stopped stays stopped', () => {
  const { world, connection } = setUp();
  connection.stop();
  world.passes(60_000);
  assert.equal(world.sockets.length, 1);
  assert.ok(world.last.closed);
});
