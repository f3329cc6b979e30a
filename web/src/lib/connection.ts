// Stream of an agent: a WebSocket. After each loss the page reopens the WebSocket, and the stream
// continues after the last event.

/** Fields that the status of every agent has. */
export interface BaseStatus {
  agent: string;
  last_event: number;
}

export interface Entry {
  number: number;
  unix_s: number;
}

export interface EventsMessage<E extends Entry = Entry> {
  agent: string;
  events: E[];
  last: number;
  missed: boolean;
}

/** The functions of a WebSocket that this module needs. */
export interface Socket {
  onopen: ((event: never) => void) | null;
  onmessage: ((event: { data: unknown }) => void) | null;
  onclose: ((event: never) => void) | null;
  onerror: ((event: never) => void) | null;
  close(): void;
}

export interface Surroundings {
  open(path: string, protocols: string[]): Socket;
  /** Time in ms, from any start. */
  now(): number;
  later(act: () => void, ms: number): unknown;
  never(handle: unknown): void;
}

export type Phase = 'connecting' | 'open' | 'waiting' | 'closed';

/**
 * Time without a message after which the connection counts as lost, ms. The agent sends at least one message every half
 * second.
 */
export const SILENT_MS = 1400;
/** Longest time to open a socket, ms. */
const OPENING_MS = 4000;
const WAIT_MS = [200, 400, 800, 1500, 2000];

export interface Handlers<S extends BaseStatus> {
  status(status: S): void;
  events(message: EventsMessage): void;
  /** Handles a message of any other kind. */
  other?(message: { kind: string }): void;
  phase(phase: Phase): void;
  /**
   * Called if a socket could not be opened. The caller must request the reason separately, because a browser does not
   * report it.
   */
  refused(): void;
}

export class Connection<S extends BaseStatus> {
  #socket: Socket | undefined;
  #timer: unknown;
  #attempt = 0;
  #agent: string | undefined;
  #after: number | undefined;
  #heard = -Infinity;
  #phase: Phase = 'closed';
  readonly #around: Surroundings;
  readonly #handlers: Handlers<S>;
  readonly #token: () => string | undefined;

  constructor(around: Surroundings, handlers: Handlers<S>, token: () => string | undefined) {
    this.#around = around;
    this.#handlers = handlers;
    this.#token = token;
  }

  get phase(): Phase {
    return this.#phase;
  }

  /** Time since the last message, ms. */
  get silence(): number {
    return this.#around.now() - this.#heard;
  }

  /** Returns `true` if the displayed state is current, because a message arrived recently. */
  get isLive(): boolean {
    return this.#phase === 'open' && this.silence < SILENT_MS;
  }

  /** Opens the stream with the current token. */
  start(): void {
    this.stop();
    this.#attempt = 0;
    this.#open();
  }

  stop(): void {
    this.#around.never(this.#timer);
    this.#timer = undefined;
    this.#drop();
    this.#enter('closed');
  }

  /**
   * Tries to open the stream at once, without waiting for the time of the next attempt. Called when the network is back,
   * or when the page is visible again.
   */
  hurry(): void {
    if (this.#phase !== 'waiting') return;
    this.#around.never(this.#timer);
    this.#attempt = 0;
    this.#open();
  }

  /** Reopens the socket after a long silence, because the loss of a network does not close the socket. */
  check(): void {
    if (this.#phase === 'open' && this.silence > 2 * SILENT_MS) this.#gone(true);
  }

  #enter(phase: Phase): void {
    if (phase === this.#phase) return;
    this.#phase = phase;
    this.#handlers.phase(phase);
  }

  #drop(): void {
    const socket = this.#socket;
    this.#socket = undefined;
    if (!socket) return;
    socket.onopen = socket.onmessage = socket.onclose = socket.onerror = null;
    socket.close();
  }

  #open(): void {
    this.#enter('connecting');
    const token = this.#token();
    const protocols = token ? ['openjtc', `bearer.${token}`] : ['openjtc'];
    const path = this.#after === undefined ? '/api/stream?after=0' : `/api/stream?after=${this.#after}`;
    let opened = false;
    const socket = this.#around.open(path, protocols);
    this.#socket = socket;
    this.#timer = this.#around.later(() => this.#gone(opened), OPENING_MS);
    socket.onopen = () => {
      opened = true;
      this.#around.never(this.#timer);
      this.#heard = this.#around.now();
      this.#enter('open');
    };
    socket.onmessage = (event) => {
      this.#attempt = 0;
      this.#heard = this.#around.now();
      if (typeof event.data === 'string') this.#take(JSON.parse(event.data) as { kind: string });
    };
    socket.onclose = () => this.#gone(opened);
    socket.onerror = () => {};
  }

  #take(message: { kind: string }): void {
    if (message.kind === 'events') {
      const events = message as unknown as EventsMessage;
      if (!this.#know(events.agent)) return;
      this.#after = events.last;
      this.#handlers.events(events);
    } else if (message.kind === 'status') {
      const status = message as unknown as S;
      if (this.#know(status.agent)) this.#handlers.status(status);
    } else {
      this.#handlers.other?.(message);
    }
  }

  /**
   * Detects another agent, whose event numbers begin again. The page then requests the events of this agent from the
   * beginning, and drops this message.
   */
  #know(agent: string): boolean {
    const other = this.#agent !== undefined && this.#agent !== agent;
    this.#agent = agent;
    if (other && this.#after !== undefined) {
      this.#after = undefined;
      this.#drop();
      this.#around.never(this.#timer);
      this.#timer = this.#around.later(() => this.#open(), 0);
      this.#enter('waiting');
      return false;
    }
    return true;
  }

  #gone(opened: boolean): void {
    this.#around.never(this.#timer);
    this.#drop();
    const wait = WAIT_MS[Math.min(this.#attempt, WAIT_MS.length - 1)] ?? 2000;
    this.#attempt += 1;
    this.#enter('waiting');
    this.#timer = this.#around.later(() => this.#open(), wait);
    if (!opened) this.#handlers.refused();
  }
}

/** Returns the browser's own functions. */
export function browser(): Surroundings {
  return {
    open: (path, protocols) => {
      const scheme = location.protocol === 'https:' ? 'wss:' : 'ws:';
      return new WebSocket(`${scheme}//${location.host}${path}`, protocols) as unknown as Socket;
    },
    now: () => performance.now(),
    later: (act, ms) => setTimeout(act, ms),
    never: (handle) => clearTimeout(handle as number | undefined),
  };
}
