// State of the page of a chain: bus, boards, values, jobs. Components read this state, and send requests through it.
import { getContext, setContext } from 'svelte';

import { History } from '../history.ts';
import { ApiError } from '../api.ts';
import { type Driven, provideSession, Session } from '../session.svelte.ts';
import type { BoardObject, BoardsMessage, ChainEntry, ChainEvent, JobObject, Status, Values, ValuesMessage } from './types.ts';
import { boardWords, busWords, type BusWords, eventWords, jobResult, jobWords, stoppedWords } from './words.ts';

/** Number of stored rows of a board's outputs: two minutes at 25 Hz. */
const ROWS = 3000;
/** Shortest interval between two updates of displayed text, ms. */
const READ_MS = 120;
/**
 * Age above which the page shows outputs as outdated, ms. The agent reports outputs as outdated after half a second.
 */
const OLD_MS = 900;
const TICK_MS = 250;

const DRIVEN: Driven = {
  thing: 'chain',
  works: 'Stop works.',
  viewerMay: 'look and stop',
  policies: [
    ['stop', 'are stopped'],
    ['continue', 'go on with the inputs that they have'],
  ],
  left: 'When this browser goes (closed, hidden for 10 s, network gone), boards that it has started',
};

/** A job, as its events describe it. */
export interface Course {
  number: number;
  what: string;
  client: string;
  own: boolean;
  over: boolean;
  /** Progress of an update: the boards that receive the image now, the attempt, the cycle and the bytes. */
  progress: { boards: number[]; attempt: number; cycle: number; bytes: number; total: number } | undefined;
  notes: string[];
}

/** A board, the time at which its state was received, and the time of its last heartbeat, by this browser's clock. */
export interface BoardView {
  board: BoardObject;
  at: number;
  beat: number | undefined;
}

export type Tab = 'boards' | 'board' | 'update' | 'doctor' | 'jobs' | 'log';

/** Questions that the page asks before a command. */
export type Question = { what: 'init' } | { what: 'run' } | { what: 'reset'; board: number };

/** States in which a board is safe even if no client holds the lease. */
const AT_REST = new Set(['exloader', 'programming']);

const KEY = Symbol('chain');
const BEAT_MS = 150;

export class ChainPage {
  readonly session: Session<Status> = new Session<Status>((entry) => eventWords((entry as ChainEntry).event), DRIVEN);

  tab = $state<Tab>('boards');
  chosen = $state<number | undefined>(undefined);
  views = $state.raw<BoardView[]>([]);
  /** True if the shown boards are current. */
  known = $state(false);
  /** The newest values of each board. The map is replaced a few times a second. */
  values = $state.raw<ReadonlyMap<number, { values: Values; at: number }>>(new Map());
  course = $state<Course | undefined>(undefined);
  jobs = $state.raw<JobObject[]>([]);
  /** Result of the last Stop that this page sent, with or without confirmation of the boards. */
  #did = $state<{ text: string; failed: boolean }>({ text: '', failed: false });
  readonly stopWords = $derived.by(() => {
    const { phase, text } = this.session.stopState;
    return phase === 'sending' || phase === 'failed' ? text : this.#did.text;
  });
  readonly stopFailed = $derived(this.session.stopState.phase === 'failed' || (this.session.stopState.phase !== 'sending' && this.#did.failed));
  question = $state<Question | undefined>(undefined);
  /** Value of performance.now(), updated a few times a second. The page computes ages with this value. */
  now = $state(performance.now());
  /** Number of Stops of all clients. When this number changes, waiting values are dropped. */
  halts = $state(0);
  /** Result of a scan or of numbering that the user has not closed yet. */
  found = $state.raw<JobObject | undefined>(undefined);

  readonly #newest = new Map<number, { values: Values; at: number }>();
  readonly #traces = new Map<number, { names: string; history: History; last: number }>();
  #read = 0;
  #agent = '';
  /** True if this agent has already sent its list of boards. */
  #boardsKnown = false;
  #stop: { at: number; ran: boolean } | undefined;
  #stopTimer: ReturnType<typeof setTimeout> | undefined;

  readonly boards = $derived(this.views.map((view) => view.board));
  readonly canCommand = $derived(this.session.role === 'operator' && this.session.fresh);
  readonly isRunning = $derived(this.course !== undefined && !this.course.over);
  readonly words = $derived.by<BusWords | undefined>(() => {
    const status = this.session.status;
    if (!status || !this.session.fresh) return undefined;
    const course = this.course && !this.course.over ? `${jobWords(this.course.what)}, by ${this.course.client}` : undefined;
    return busWords(status, this.boards, course);
  });
  readonly runs = $derived(this.boards.some((board) => board.state === 'running' || board.state === 'started'));

  constructor() {
    this.session.onStatus((status) => this.#take(status));
    this.session.onEvent((entry, isNew) => this.#happened((entry as ChainEntry).event, isNew));
    this.session.onMessage((message) => this.#receive(message));
    this.session.onLoss(() => this.#lose());
    this.session.saysOfStop = () => ({ text: this.stopWords, failed: this.stopFailed });
    this.session.onMissed(() => void this.readJobs());
    // A lost board may still run.
    this.session.isAtRest = () => this.known && this.#boardsKnown && !this.isRunning && this.boards.every((board) => AT_REST.has(board.state));
    // Boards that this page has started stop when the lease of the page expires. The page therefore renews the lease
    // while the boards run and the page is visible.
    this.session.isBusy = () => this.session.leasePhase === 'held' && (this.runs || ((this.course?.own ?? false) && !this.course?.over));
  }

  start(): void {
    this.session.start();
    setInterval(() => {
      if (!document.hidden) this.now = performance.now();
    }, TICK_MS);
  }

  choose(number: number, open: boolean): void {
    this.chosen = number;
    if (open || this.tab !== 'boards') this.tab = 'board';
  }

  view(number: number | undefined): BoardView | undefined {
    return this.views.find((view) => view.board.number === number);
  }

  /** Returns `true` if outputs that were received at this time are outdated. */
  isOld(of: { values: Values; at: number } | undefined): boolean {
    return !this.known || !of || of.values.stale || (of.values.age_s ?? Infinity) * 1000 + (this.now - of.at) > OLD_MS;
  }

  /** Returns the last minutes of the outputs of a board: the time, then a column for each output. */
  trace(number: number): History | undefined {
    return this.#traces.get(number)?.history;
  }

  /**
   * Sends a command. Shows a refusal as a message. `ends`: the command moves no board, and the agent executes it even
   * after a Stop.
   */
  async command<T = unknown>(what: string, method: string, path: string, body?: unknown, ends = false): Promise<{ value: T } | undefined> {
    // The timeout is long, because boards answer one after the other and a running job first ends its own operation. A
    // command has no effect after a Stop that this page had not yet shown, even if the command arrives late.
    return this.session.command<T>(what, method, path, { ...(body === undefined ? {} : { body }), moves: !ends, ends, within: 30_000 });
  }

  scan(): void {
    void this.command('Scan', 'POST', '/api/scan', undefined, true);
  }

  cancel(): void {
    const job = this.course;
    if (job) void this.command(`Cancel ${jobWords(job.what).toLowerCase()}`, 'DELETE', `/api/jobs/${job.number}`, undefined, true);
  }

  async stop(): Promise<void> {
    // The page sends the Stop before all other steps, and then shows the messages.
    const sent = this.session.stop();
    const at = this.session.stopState.at;
    this.halts += 1;
    this.#stop = { at, ran: this.runs || this.isRunning || !this.known };
    this.#say('', false);
    await sent;
    if (this.#stop?.at !== at) return;
    if (this.session.stopState.phase !== 'sent') {
      this.#stop = undefined;
      return;
    }
    const updates = this.isRunning && this.course?.what === 'update';
    this.#say(updates ? 'Stop was sent to all boards; they are asked when the update is over. Cancel ends the update.' : 'Stop was sent to all boards; each is being asked.', false);
  }

  #say(text: string, failed: boolean): void {
    clearTimeout(this.#stopTimer);
    this.#did = { text, failed };
  }

  #wordStop(event: Extract<ChainEvent, { kind: 'stopped' }>): void {
    const { text, failed, why } = stoppedWords(event, this.#stop?.ran ?? true);
    if (!this.#stop && !failed) return;
    const took = this.#stop?.ran && !failed && event.boards.length > 0 ? ` ${((performance.now() - this.#stop.at) / 1000).toFixed(1)} s.` : '';
    this.#stop = undefined;
    this.#say(text + took, failed);
    if (failed) this.session.toast({ tone: 'error', title: 'Not stopped', text: why });
    else this.#stopTimer = setTimeout(() => this.#say('', false), 12_000);
  }

  #take(status: Status): void {
    if (status.agent !== this.#agent) {
      const other = this.#agent !== '';
      this.#agent = status.agent;
      if (other) {
        this.course = undefined;
        this.found = undefined;
        this.#stop = undefined;
        this.#boardsKnown = false;
        this.#say('', false);
        this.#newest.clear();
        this.values = new Map();
      }
      void this.readJobs();
    }
    const known = this.session.fresh;
    if (known !== this.known) this.known = known;
  }

  #receive(message: { kind: string }): void {
    if (message.kind === 'boards') this.#takeBoards((message as BoardsMessage).boards);
    else if (message.kind === 'values') this.#takeValues((message as ValuesMessage).values);
  }

  #takeBoards(boards: BoardObject[]): void {
    this.#boardsKnown = true;
    const at = performance.now();
    const before = new Map(this.views.map((view) => [view.board.number, view]));
    this.views = boards.map((board) => {
      const beat = board.heartbeat_age_s == null ? undefined : at - board.heartbeat_age_s * 1000;
      const last = before.get(board.number)?.beat;
      // If the times differ only by the delay of the messages, both messages report one heartbeat.
      return { board, at, beat: beat !== undefined && last !== undefined && Math.abs(beat - last) < BEAT_MS ? last : beat };
    });
    if (this.chosen === undefined || !boards.some((board) => board.number === this.chosen)) this.chosen = boards[0]?.number;
  }

  #takeValues(list: Values[]): void {
    const at = performance.now();
    for (const values of list) {
      this.#newest.set(values.board, { values, at });
      if (!values.stale) this.#remember(values);
    }
    if (at - this.#read < READ_MS) return;
    this.#read = at;
    this.values = new Map(this.#newest);
  }

  #remember(values: Values): void {
    const names = values.outputs.map((output) => output.name).join('\n');
    let trace = this.#traces.get(values.board);
    if (!trace || trace.names !== names) {
      trace = { names, history: new History(values.outputs.length + 1, ROWS), last: 0 };
      this.#traces.set(values.board, trace);
    }
    const row = values.outputs.map((output) => (typeof output.value === 'number' ? output.value : typeof output.value === 'boolean' ? Number(output.value) : NaN));
    // The times always increase, so that a delayed message does not place a value before an earlier value.
    trace.last = Math.max(trace.last + 0.001, Date.now() / 1000 - (values.age_s ?? 0));
    trace.history.push([trace.last, ...row]);
  }

  /** Marks all known data as outdated. */
  #lose(): void {
    this.known = false;
    this.halts += 1;
    // The plots show a gap here instead of a line.
    for (const trace of this.#traces.values()) {
      const row = new Array<number>(trace.history.channels).fill(NaN);
      row[0] = trace.last = Math.max(trace.last + 0.001, Date.now() / 1000);
      trace.history.push(row);
    }
  }

  #happened(event: ChainEvent, isNew: boolean): void {
    const course = 'job' in event && this.course?.number === event.job ? this.course : undefined;
    switch (event.kind) {
      case 'begun':
        // The page shows the result of a Stop until the next job.
        if (isNew && !this.#stop) {
          this.#say('', false);
          this.session.forgetStop();
        }
        this.course = {
          number: event.job, what: event.what, client: event.client, over: false, progress: undefined, notes: [],
          own: this.session.leasePhase === 'held' && event.client === this.session.name,
        };
        break;
      case 'progress':
        if (course) course.progress = event;
        break;
      case 'job_note':
        if (course) course.notes = [...course.notes.slice(-5), event.text];
        break;
      case 'ended':
        if (course) course.over = true;
        if (isNew) void this.#ended(event.job);
        break;
      case 'halt':
        this.halts += 1;
        if (isNew && !this.#stop && performance.now() - this.session.stopState.at > 3000) this.session.toast({ tone: 'info', title: 'Stopped', text: `By ${event.by}.` });
        break;
      case 'stopped':
        if (isNew) this.#wordStop(event);
        break;
      case 'heartbeat': {
        const title = event.board ? `Board ${event.board} is lost` : 'A board is lost';
        if (isNew && event.change === 'lost') this.session.toast({ tone: 'error', title, text: 'No heartbeat for 3 s: it may still run.' });
        else this.session.toasts = this.session.toasts.filter((toast) => toast.title !== title);
        break;
      }
      case 'state': {
        // Inputs and outputs from before a restart of the board are outdated.
        const view = this.view(event.board);
        if (view && event.state === 'exloader' && this.#newest.delete(event.board)) this.values = new Map(this.#newest);
        break;
      }
    }
  }

  async #ended(number: number): Promise<void> {
    await this.readJobs();
    const job = this.jobs.find((each) => each.number === number);
    if (!job) return;
    if (job.chain) this.found = job;
    const own = this.course?.number === number && this.course.own;
    // The page shows no message for a cancelled job, because the user already knows about it. The page also shows no
    // message for an update while the update tab shows the outcome.
    if (!own || job.stage === 'cancelled' || (job.update && this.tab === 'update')) return;
    if (job.error) this.session.toast({ tone: 'error', title: jobWords(job.what), text: job.error.message, problem: job.error });
    else if (job.stage === 'finished' && !job.chain) this.session.toast({ tone: 'good', title: jobWords(job.what), text: jobResult(job) });
  }

  async readJobs(): Promise<void> {
    try {
      this.jobs = await this.session.api.get<JobObject[]>('/api/jobs');
      const course = this.course;
      if (course && !course.over && this.jobs.some((job) => job.number === course.number && job.stage !== 'running')) course.over = true;
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
    }
  }

  /**
   * Reads the values of a board that sends no outputs. If the agent does not know the names of its signals, the agent
   * asks the board.
   */
  async readValues(number: number): Promise<void> {
    await this.session.attempt(`Values of board ${number}`, async () => {
      const values = await this.session.api.get<Values>(`/api/boards/${number}/values`);
      this.#newest.set(number, { values, at: performance.now() });
      this.values = new Map(this.#newest);
    });
  }

  /** Shows inputs and parameters at once when the agent has confirmed them. */
  confirm(number: number, list: 'inputs' | 'parameters', value: Values['inputs'][number]): void {
    const old = this.#newest.get(number);
    if (!old) return;
    const merged = old.values[list].map((each) => (each.index === value.index ? { ...each, ...value } : each));
    this.#newest.set(number, { ...old, values: { ...old.values, [list]: merged } });
    this.values = new Map(this.#newest);
  }

  /** Returns the state of a board as text. For an outdated state, the text says that the state is unknown. */
  boardWords(board: BoardObject): ReturnType<typeof boardWords> {
    return this.known ? boardWords(board) : { tone: 'lost', word: 'Not known', detail: 'Nothing is received from the agent.' };
  }
}

export function provideChain(chain: ChainPage): void {
  setContext(KEY, chain);
  provideSession(chain.session);
}

export function useChain(): ChainPage {
  return getContext<ChainPage>(KEY);
}
