// Functions that all pages share: connection, token, lease, Stop, messages, events. The shared functions do not
// depend on the device that the agent controls.
import { getContext, setContext } from 'svelte';

import { Api, ApiError, type Ask, type Problem } from './api.ts';
import { type BaseStatus, browser, Connection, type Entry, type EventsMessage, type Phase } from './connection.ts';
import { deviceKind } from './keys.ts';
import { Lease, type LeasePhase, type Policy, RENEW_MS } from './lease.ts';
import { Lateness } from './lateness.ts';
import { device, tab } from './storage.ts';
import { applyTheme, savedTheme, type Theme } from './theme.ts';
import { tokenIn, TokenStore } from './token.ts';

export interface LeaseView {
  holder: string;
  age_ms: number;
  left_ms?: number | null;
  wanted_by?: string | null;
}

export interface SessionStatus extends BaseStatus {
  role: 'viewer' | 'operator';
  last_halt?: number;
  lease?: LeaseView | null;
  /** Time since the last status of the device, ms. */
  age_ms?: number | null;
  lost?: string | null;
  simulated?: boolean;
  /** Time of the agent when this message was created, ms. */
  at_ms?: number | undefined;
}

export interface Toast {
  id: number;
  tone: 'info' | 'good' | 'error';
  title: string;
  text: string;
  problem?: Problem;
  /** A button next to the message that carries out a remedy. */
  action?: { word: string; act: () => void };
}

export interface Line {
  /** Number that this page has given the event line. A new agent restarts its own event numbers. */
  id: number;
  unix_s: number;
  text: string;
  tone: 'info' | 'good' | 'warn' | 'error';
  /** Origin of the event, in a word. */
  of: string;
}

export interface StopState {
  phase: 'idle' | 'sending' | 'sent' | 'failed';
  /** Times of the touch and of the answer, from performance.now(). */
  at: number;
  answered: number;
  text: string;
}

/** Texts about the controlled device. */
export interface Driven {
  /** Word for the device: `arm` or `chain`. */
  thing: string;
  /** Sentence about the commands that need neither the lease nor the operator's token. */
  works: string;
  /** Actions that a viewer's token allows. */
  viewerMay: string;
  /**
   * Policies for a running motion after this browser has disconnected. The usual policy is first. Each policy has the
   * words that complete the sentence `left`.
   */
  policies: readonly [[Policy, string], ...[Policy, string][]];
  left: string;
}

/** Function that turns an event into a line of the event list. */
export type Describe = (entry: Entry) => Omit<Line, 'id' | 'unix_s'> | undefined;

/**
 * Time after a touch of the page during which the page renews the lease, ms. A running job of this page also causes
 * renewals.
 */
const IN_USE_MS = 120_000;
const LINES_MAX = 400;
/** Interval at which the page requests the agent's time until it knows this time, ms. */
const PROBE_MS = 1000;
/** Longest wait for the lease, ms. After a longer wait, a command that may move the device is not sent. */
const LEASE_MAX_MS = 3000;
/** Shortest time for which the page shows that a Stop failed, ms. */
const FAILED_MS = 20_000;
/** Age above which the page shows status values as outdated, ms. */
const OLD_MS = 1500;

function load(name: string): string | null {
  return device.getItem(`openjtc-${name}`);
}

function save(name: string, value: string): void {
  device.setItem(`openjtc-${name}`, value);
}

const KEY = Symbol('session');

/** Makes the session available to the components of a page. */
export function provideSession<S extends SessionStatus>(session: Session<S>): void {
  setContext(KEY, session);
}

export function useSession(): Session<SessionStatus> {
  return getContext<Session<SessionStatus>>(KEY);
}

export class Session<S extends SessionStatus> {
  readonly api: Api;
  readonly lease: Lease;
  readonly connection: Connection<S>;
  readonly tokens = new TokenStore(tab, device);

  phase = $state<Phase>('connecting');
  /** True if messages arrive from the agent. */
  live = $state(false);
  /** True if the device answers the agent. */
  fresh = $state(false);
  /** Delay of messages that arrive steadily, s. 0: the state is not unknown because of a delay. */
  late = $state(0);
  /** Time without a connection in whole seconds. */
  lostFor = $state(0);
  status = $state.raw<S | undefined>(undefined);
  role = $state<'viewer' | 'operator'>('viewer');
  hasToken = $state(false);
  denied = $state<Problem | undefined>(undefined);
  /** Reason why the token dialog is open. */
  asksToken = $state<string | undefined>(undefined);
  leasePhase = $state<LeasePhase>('none');
  wantedBy = $state<string | undefined>(undefined);
  holder = $state<string | undefined>(undefined);
  toasts = $state<Toast[]>([]);
  lines = $state.raw<Line[]>([]);
  stopState = $state<StopState>({ phase: 'idle', at: 0, answered: 0, text: '' });
  theme = $state<Theme>(savedTheme());
  name = $state(load('name') ?? deviceKind(navigator.userAgent, navigator.maxTouchPoints, screen.width));
  policy = $state<Policy>('stop');

  /** `true` while a job of this page runs. */
  isBusy: () => boolean = () => false;
  /**
   * `true` if no motion would continue without a lease. If no motion would continue, the page releases the lease when
   * it closes. Otherwise the lease expires, and the policy of the lease applies.
   */
  isAtRest: () => boolean = () => false;
  /** Result of the last Stop, in the words of the page. Empty: the page shows no message. */
  saysOfStop: () => { text: string; failed: boolean } = () => ({ text: this.stopState.text, failed: this.stopState.phase === 'failed' });
  readonly #statusHandlers: ((status: S) => void)[] = [];
  readonly #eventHandlers: ((entry: Entry, isNew: boolean) => void)[] = [];
  readonly #messageHandlers: ((message: { kind: string }) => void)[] = [];
  readonly #lossHandlers: (() => void)[] = [];
  readonly #missedHandlers: (() => void)[] = [];
  readonly #lateness = new Lateness();
  readonly of: Driven;
  readonly #describe: Describe;
  #probes = 0;
  /** Number of Stops that are being sent, or repeated. */
  #stopping = 0;
  #touched = 0;
  #toastId = 0;
  #lineId = 0;
  /** Time of the last status, and the delay of this status. */
  #statusAt = -Infinity;
  #late = 0;
  #halt = 0;
  #known = -1;
  #agent = '';
  #lostAt = performance.now();
  #probing = false;
  /** Token whose refusal the page has reported. An empty string: no token was sent. */
  #refused: string | undefined;

  constructor(describe: Describe, of: Driven) {
    this.#describe = describe;
    this.of = of;
    const saved = load('policy');
    this.policy = of.policies.find(([policy]) => policy === saved)?.[0] ?? of.policies[0][0];
    const { token, rest } = tokenIn(location.hash);
    if (token) {
      this.tokens.use(token);
      history.replaceState(null, '', location.pathname + location.search + rest);
    }
    this.hasToken = this.tokens.get() !== undefined;
    this.api = new Api(
      () => this.tokens.get(),
      () => this.lease.key,
    );
    this.lease = new Lease(this.api, {
      name: () => this.name,
      policy: () => this.policy,
      changed: () => {
        this.leasePhase = this.lease.phase;
        this.wantedBy = this.lease.wantedBy;
      },
    });
    this.connection = new Connection<S>(
      browser(),
      {
        status: (status) => this.#take(status),
        events: (message) => this.#receive(message),
        other: (message) => {
          for (const handler of this.#messageHandlers) handler(message);
        },
        phase: (phase) => {
          this.phase = phase;
          this.#look();
        },
        refused: () => void this.#probe(),
      },
      () => this.tokens.get(),
    );
  }

  onStatus(handler: (status: S) => void): void {
    this.#statusHandlers.push(handler);
  }

  onEvent(handler: (entry: Entry, isNew: boolean) => void): void {
    this.#eventHandlers.push(handler);
  }

  /** Calls `handler` with each message of the stream that is neither a status nor an event. */
  onMessage(handler: (message: { kind: string }) => void): void {
    this.#messageHandlers.push(handler);
  }

  /** Calls `handler` when the displayed state becomes outdated. */
  onLoss(handler: () => void): void {
    this.#lossHandlers.push(handler);
  }

  /** Calls `handler` when the page has missed events, so that the current job must be requested. */
  onMissed(handler: () => void): void {
    this.#missedHandlers.push(handler);
  }

  start(): void {
    applyTheme(this.theme);
    this.connection.start();
    setInterval(() => this.#look(), 200);
    setInterval(() => void this.#renew(), RENEW_MS);
    setInterval(() => void this.#probeTime(), PROBE_MS);
    const touch = () => (this.#touched = performance.now());
    for (const event of ['pointerdown', 'keydown', 'wheel']) addEventListener(event, touch, { passive: true, capture: true });
    addEventListener('online', () => this.connection.hurry());
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden) this.connection.hurry();
    });
    addEventListener('pagehide', () => {
      // If a job runs, the page does not release the lease. The lease then expires, and the chosen policy applies.
      if (this.lease.phase === 'waiting' || this.isAtRest()) void this.lease.release(true).catch(() => {});
    });
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
    applyTheme(theme);
  }

  setName(name: string): void {
    this.name = name.trim().slice(0, 64) || deviceKind(navigator.userAgent, navigator.maxTouchPoints, screen.width);
    save('name', this.name);
  }

  setPolicy(policy: Policy): void {
    this.policy = policy;
    save('policy', policy);
  }

  setToken(token: string, remember: boolean): void {
    this.lease.lost();
    this.tokens.set(token.trim(), remember);
    this.hasToken = true;
    this.denied = undefined;
    this.asksToken = undefined;
    this.connection.start();
  }

  forgetToken(): void {
    void this.lease.release().catch(() => {});
    this.tokens.forget();
    this.hasToken = false;
    this.connection.start();
  }

  /**
   * Number of the last Stop, for a command that the user requests now. A later Stop prevents the motion of this
   * command.
   */
  get askedAfter(): number | undefined {
    const shown = this.status?.last_halt;
    return shown === undefined ? undefined : Math.max(shown, this.#halt);
  }

  /**
   * The agent's time as far as this page knows it. If a command with this time arrives late, the agent refuses the
   * command.
   */
  get agentTime(): number | undefined {
    return this.#lateness.agentTime(performance.now());
  }

  /**
   * Sends a Stop before all other requests. Sends it again if the network drops the request. `stopState` has the result
   * of the last touch only. `stopState` shows that the Stop is unconfirmed until the agent confirms it.
   */
  async stop(): Promise<void> {
    const at = performance.now();
    this.api.recall('A Stop came before it was sent');
    this.stopState = { phase: 'sending', at, answered: 0, text: 'Stop is being sent' };
    const enter = (phase: StopState['phase'], text: string) => {
      if (this.stopState.at === at) this.stopState = { phase, at, answered: performance.now(), text };
    };
    this.#stopping += 1;
    try {
      await this.#tryToStop(at, enter);
    } finally {
      this.#stopping -= 1;
    }
  }

  async #tryToStop(at: number, enter: (phase: StopState['phase'], text: string) => void): Promise<void> {
    for (let attempt = 1; ; attempt += 1) {
      try {
        const sent = await this.#halting('/api/stop', 1500);
        this.#halt = Math.max(this.#halt, sent?.halt ?? 0);
        enter('sent', 'Stop was sent');
        return;
      } catch (error) {
        const problem = error instanceof ApiError ? error : undefined;
        const why = problem?.problem.message ?? 'It was not sent.';
        if (problem?.isNoConnection && attempt < 5 && this.stopState.at === at) {
          enter('failed', `STOP NOT CONFIRMED. Use the emergency stop. ${why} It is tried again.`);
          await new Promise((done) => setTimeout(done, 150));
          continue;
        }
        enter('failed', `STOP NOT SENT. Use the emergency stop. ${why}`);
        if (problem?.wantsToken && this.stopState.at === at) this.asksToken = 'Stop from this device needs a token, too.';
        return;
      }
    }
  }

  /** Removes the message about the last Stop, unless the page is still sending the Stop. */
  forgetStop(): void {
    if (this.#stopping === 0) this.stopState = { phase: 'idle', at: 0, answered: 0, text: '' };
  }

  /** Pauses the motion. A pause needs no lease. */
  async pause(): Promise<boolean> {
    return (await this.attempt('Pause', () => this.#halting('/api/pause', 3000), (sent) => {
      this.#halt = Math.max(this.#halt, sent?.halt ?? 0);
    })) !== undefined;
  }

  /** Sends Stop or Pause. An expired token does not block a client that needs no token. */
  async #halting(path: string, within: number): Promise<{ halt?: number } | undefined> {
    try {
      return await this.api.json<{ halt?: number }>('POST', path, { within, ahead: true });
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 401 || !this.hasToken) throw error;
      return this.api.json<{ halt?: number }>('POST', path, { within, ahead: true, bare: true }).catch((second: unknown) => {
        throw second instanceof ApiError && second.isNoConnection ? second : error;
      });
    }
  }

  /**
   * Sends a command, with the lease. A command that may move the device also contains the state that this page showed
   * when the user requested the command. The state is the present state, or `after` for a later part of the same
   * request. Returns the answer. If the agent refuses the command, returns undefined and shows the reason as a message.
   */
  async command<T = unknown>(
    what: string, method: string, path: string, ask: Ask & { moves?: boolean; after?: number | undefined; quiet?: boolean } = {},
  ): Promise<{ value: T } | undefined> {
    const after = ask.moves ? (ask.after ?? this.askedAfter) : undefined;
    const query = after === undefined ? ask.query : { ...ask.query, asked_after: after };
    const asked = performance.now();
    const act = async (): Promise<{ value: T }> => {
      const had = this.lease.phase === 'held';
      await this.lease.take();
      if (ask.moves && performance.now() - asked > LEASE_MAX_MS) {
        throw new ApiError(0, { code: 'not-sent', message: 'The lease came too late for it; nothing was sent.', next: 'Ask for it again.' });
      }
      try {
        return { value: await this.api.json<T>(method, path, query ? { ...ask, query } : ask) };
      } catch (error) {
        // If the lease has expired while the page was idle, the page takes the lease again, once.
        if (!had || !(error instanceof ApiError) || error.problem.code !== 'denied' || error.problem.next.includes('three seconds')) throw error;
        if (await this.lease.renew()) throw error;
        await this.lease.take();
        return { value: await this.api.json<T>(method, path, query ? { ...ask, query } : ask) };
      }
    };
    return this.attempt(what, act, undefined, ask.quiet);
  }

  /** Calls `act`. If `act` fails, shows the reason. */
  async attempt<T>(what: string, act: () => Promise<T>, then?: (value: T) => void, quiet = false): Promise<T | undefined> {
    try {
      const value = await act();
      then?.(value);
      return value;
    } catch (error) {
      if (!quiet) this.fail(what, error);
      return undefined;
    }
  }

  fail(what: string, error: unknown): void {
    if (!(error instanceof ApiError)) {
      this.toast({ tone: 'error', title: what, text: error instanceof Error ? error.message : String(error) });
      return;
    }
    if (error.wantsToken) {
      this.asksToken = this.hasToken
        ? `${what}: this token does not allow it. ${error.problem.message}`
        : `${what} needs the operator's token.`;
      return;
    }
    const problem = error.problem;
    const held = problem.code === 'denied' && this.leasePhase !== 'held' && this.holder !== undefined;
    const toast: Omit<Toast, 'id'> = { tone: 'error', title: what, text: problem.message, problem };
    if (held) {
      toast.problem = { ...problem, next: `Ask ${this.holder} for the lease, or wait until it is free.` };
      toast.action = { word: 'Ask for it', act: () => void this.askForLease() };
    }
    this.toast(toast);
  }

  async askForLease(): Promise<void> {
    await this.attempt('Ask for the lease', () => this.lease.ask());
  }

  toast(toast: Omit<Toast, 'id'>): void {
    this.#toastId += 1;
    const id = this.#toastId;
    const same = this.toasts.filter((other) => other.title !== toast.title || other.text !== toast.text);
    this.toasts = [...same.slice(-3), { ...toast, id }];
    if (toast.tone !== 'error') setTimeout(() => this.dismiss(id), 5000);
  }

  dismiss(id: number): void {
    this.toasts = this.toasts.filter((toast) => toast.id !== id);
  }

  #take(status: S): void {
    if (this.status?.agent !== status.agent) {
      // Another agent begins with new Stop numbers and a new time.
      this.#halt = 0;
      this.#lateness.forget();
    }
    this.status = status;
    this.#statusAt = performance.now();
    this.#late = status.at_ms === undefined ? 0 : this.#lateness.take(status.at_ms, this.#statusAt);
    if (this.role !== status.role) this.role = status.role;
    const holder = status.lease?.holder;
    if (this.holder !== holder) this.holder = holder;
    this.denied = undefined;
    this.#look();
    for (const handler of this.#statusHandlers) handler(status);
  }

  #receive(message: EventsMessage): void {
    if (message.agent !== this.#agent) {
      this.#agent = message.agent;
      this.#known = -1;
    }
    // Events that occurred before the page was opened are not new.
    const isFirst = this.#known < 0;
    const fresh: Line[] = [];
    for (const entry of message.events) {
      if (entry.number <= this.#known) continue;
      const isNew = !isFirst || Date.now() / 1000 - entry.unix_s < 2;
      const words = this.#describe(entry);
      if (words) fresh.push({ id: (this.#lineId += 1), unix_s: entry.unix_s, ...words });
      for (const handler of this.#eventHandlers) handler(entry, isNew);
    }
    this.#known = Math.max(this.#known, message.last);
    if (message.missed && !isFirst) {
      fresh.unshift({ id: (this.#lineId += 1), unix_s: Date.now() / 1000, text: 'Some events are not kept any more.', tone: 'warn', of: 'agent' });
      for (const handler of this.#missedHandlers) handler();
    }
    if (fresh.length > 0) this.lines = [...this.lines, ...fresh].slice(-LINES_MAX);
  }

  /** Updates `live` and `fresh`. */
  #look(): void {
    this.connection.check();
    const live = this.connection.isLive;
    const status = this.status;
    const age = (status?.age_ms ?? Infinity) + (performance.now() - this.#statusAt) + this.#late;
    const fresh = live && status !== undefined && !status.lost && age < OLD_MS;
    if (live !== this.live) {
      this.live = live;
      if (!live) this.#lostAt = performance.now() - Math.min(this.connection.silence, 10_000);
    }
    const late = live && !fresh && this.#late > OLD_MS ? Math.round(this.#late / 1000) : 0;
    if (late !== this.late) this.late = late;
    if (fresh !== this.fresh) {
      this.fresh = fresh;
      if (!fresh) {
        // The page drops the waiting commands, because the user requested them for a state that is now outdated.
        this.api.recall('The connection was lost');
        for (const handler of this.#lossHandlers) handler();
      }
    }
    // The page has shown the failure long enough, and the device is at rest. A new job hides the failure at once.
    if (this.stopState.phase === 'failed' && performance.now() - this.stopState.answered > FAILED_MS && this.isAtRest()) this.forgetStop();
    const lostFor = live ? 0 : Math.floor((performance.now() - this.#lostAt) / 1000);
    if (lostFor !== this.lostFor) this.lostFor = lostFor;
  }

  async #renew(): Promise<void> {
    if (this.lease.phase === 'none' || document.hidden) return;
    const inUse = performance.now() - this.#touched < IN_USE_MS || this.isBusy();
    if (inUse) {
      const had = this.lease.phase;
      const held = await this.lease.renew();
      if (had === 'held' && !held && this.connection.isLive) {
        this.toast({ tone: 'error', title: 'The lease has ended', text: 'Commands from this page take it again, where nobody else has it.' });
      } else if (had === 'waiting' && held) {
        this.toast({ tone: 'good', title: 'You command now', text: 'The lease is here.' });
      }
    }
  }

  /** Requests the agent's time, so that the page detects a delay of all messages. */
  async #probeTime(): Promise<void> {
    if (!this.live || document.hidden) return;
    this.#probes += 1;
    // The page requests the time often until it knows the time, then occasionally.
    if (this.#probes > 4 && this.#probes % 5 !== 0) return;
    const [sent, agent] = [performance.now(), this.status?.agent];
    try {
      const { at_ms } = await this.api.json<{ at_ms?: number }>('GET', '/api/status', { ahead: true, yields: true, within: 4000 });
      if (at_ms !== undefined && this.status?.agent === agent) this.#lateness.probe(sent, at_ms);
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
    }
  }

  /** Sends an ordinary request to find out why a socket was refused, because a browser does not report the reason. */
  async #probe(): Promise<void> {
    if (this.#probing) return;
    this.#probing = true;
    try {
      await this.api.get('/api/status');
    } catch (error) {
      if (error instanceof ApiError && !error.isNoConnection) {
        this.denied = error.problem;
        // The page opens the dialog only once for each token. A user who has closed the dialog can open it again next
        // to the state.
        const token = this.tokens.get() ?? '';
        if (error.wantsToken && this.#refused !== token) {
          this.#refused = token;
          this.asksToken ??= this.hasToken
            ? `This token was not accepted. ${error.problem.message}`
            : 'Looking at this agent from here needs a token.';
        }
      }
    } finally {
      this.#probing = false;
    }
  }
}
