// State of the page of an arm: model, controller, jobs, preview. Components read this state, and send requests
// through it.
import { getContext, setContext } from 'svelte';

import { ApiError } from '../api.ts';
import type { AngleUnit } from '../format.ts';
import { type Driven, provideSession, Session } from '../session.svelte.ts';
import { History } from '../history.ts';
import { device } from '../storage.ts';
import type { ArmModel } from './kinematics.ts';
import { freeNumber } from './numbers.ts';
import type { ArmEntry, Controller, InfoObject, JobObject, PayloadObject, Points, Pose, ProblemObject, Status, TrajectoryObject } from './types.ts';
import { eventWords, isMoving, isPaused, jobWords, stateWords, type StateWords, whatStopDid } from './words.ts';

/** First column of each quantity in the history. Column 0 is the time, and each quantity has six columns. */
export const COLUMN = { position: 1, velocity: 7, torque: 13, temperature: 19, commanded: 25, error: 31 } as const;
const COLUMNS = 37;
/** Number of stored rows: ten minutes at 25 Hz. */
const ROWS = 15_000;
/** Shortest interval between two updates of displayed text, ms. */
const READ_MS = 120;

/** A job, as its events describe it. */
export interface Course {
  number: number;
  what: string;
  client: string;
  phase: string;
  stage: 'begun' | 'uploading' | 'executing' | 'ended';
  /** Progress of the phase of the job, 0 to 1. */
  progress: number;
  duration_s: number;
  runs: number;
  outcome?: string;
  own: boolean;
}

/** Texts for the stages of a job before a motion. */
const STAGES = { begun: ': being prepared', uploading: ': being uploaded', executing: '', ended: '' };

export interface Preview {
  points: Points;
  /** Time on the slider, s. */
  time: number;
  problems: ProblemObject[];
  title: string;
}

export type Tab = 'state' | 'run' | 'jog' | 'teach' | 'arm' | 'plots' | 'log';

const DRIVEN: Driven = {
  thing: 'arm',
  works: 'Pause and Stop work.',
  viewerMay: 'look, pause and stop',
  policies: [
    ['pause', 'pauses on its path'],
    ['stop', 'is stopped'],
    ['continue', 'goes on to its end'],
  ],
  left: 'When this browser goes in a motion (closed, hidden for 10 s, network gone), the motion',
};

const KEY = Symbol('arm');

export class ArmPage {
  readonly session = new Session<Status>((entry) => eventWords((entry as ArmEntry).event), DRIVEN);
  readonly history = new History(COLUMNS, ROWS);

  tab = $state<Tab>('state');
  unit = $state<AngleUnit>(device.getItem('openjtc-unit') === 'rad' ? 'rad' : 'deg');
  /** Status of the controller that the page displays; undefined: no current status. */
  controller = $state.raw<Controller | undefined>(undefined);
  /** Latest received status, for the scene and the plots. */
  latest: Controller | undefined;
  model = $state.raw<ArmModel | undefined>(undefined);
  info = $state.raw<InfoObject | undefined>(undefined);
  payload = $state.raw<PayloadObject | undefined>(undefined);
  poses = $state.raw<Pose[]>([]);
  posesMissing = $state(false);
  trajectories = $state.raw<TrajectoryObject[]>([]);
  course = $state<Course | undefined>(undefined);
  lastJob = $state.raw<JobObject | undefined>(undefined);
  speed = $state(100);
  preview = $state<Preview | undefined>(undefined);
  /** Joint under the pointer, from 1. */
  pointed = $state<number | undefined>(undefined);
  explained = $state<string | undefined>(undefined);
  /** True while the page asks which arm this is, before it recovers the arm. */
  asksArm = $state(false);
  /** Arm file that the user has opened, to compare it or to send it to the controller. */
  armFile = $state.raw<{ name: string; text: string } | undefined>(undefined);
  /** Result of the last Stop that this page sent. */
  #did = $state('');
  readonly stopWords = $derived.by(() => {
    const { phase, text } = this.session.stopState;
    return phase === 'idle' ? '' : phase === 'sent' ? this.#did || `${text}.` : text;
  });

  readonly #frames: ((controller: Controller | undefined) => void)[] = [];
  #read = 0;
  #agent = '';
  #stop: { at: number; state: string | undefined; moved: boolean; job: boolean } | undefined;

  readonly words = $derived.by<StateWords | undefined>(() => {
    if (!this.controller) return undefined;
    const course = this.course && this.course.stage !== 'ended' ? `${jobWords(this.course.what)}, by ${this.course.client}${STAGES[this.course.stage]}` : undefined;
    return stateWords(this.controller, course, this.info?.missing ?? []);
  });
  readonly canCommand = $derived(this.session.role === 'operator' && this.session.fresh);
  /** True if the controller lacks friction, gains or model. */
  readonly lacksArm = $derived((this.info?.missing.length ?? 0) > 0);
  readonly isRunning = $derived(this.course !== undefined && this.course.stage !== 'ended');

  constructor() {
    this.session.onStatus((status) => this.#take(status));
    this.session.onEvent((entry, isNew) => this.#receive(entry as ArmEntry, isNew));
    this.session.onLoss(() => this.#lose());
    this.session.saysOfStop = () => ({ text: this.stopWords, failed: this.session.stopState.phase === 'failed' });
    this.session.onMissed(() => void this.readJobs());
    this.session.isAtRest = () => this.session.fresh && !this.isRunning && this.latest?.state !== 'Teaching' && !isMoving(this.latest) && !isPaused(this.latest);
    this.session.isBusy = () => (this.course?.own ?? false) && this.course?.stage !== 'ended';
  }

  /** Calls `handler` with each status, and with undefined if the current status is missing. */
  onFrame(handler: (controller: Controller | undefined) => void): () => void {
    this.#frames.push(handler);
    return () => this.#frames.splice(this.#frames.indexOf(handler), 1);
  }

  setUnit(unit: AngleUnit): void {
    this.unit = unit;
    device.setItem('openjtc-unit', unit);
  }

  /** Recovers the arm. If the controller has no parameters, the page first asks which arm this is. */
  recover(): void {
    if (this.lacksArm) this.asksArm = true;
    else void this.session.command('Recover', 'POST', '/api/recover', { body: {}, moves: true });
  }

  /** Measured positions of the joints, or undefined if a position is unknown. */
  get position(): number[] | undefined {
    const values = this.controller?.joints.map((joint) => joint.position_rad);
    return values?.every((value) => typeof value === 'number') ? (values as number[]) : undefined;
  }

  async stop(): Promise<void> {
    // The page sends the Stop before all other steps, and then shows the messages.
    const sent = this.session.stop();
    const controller = this.latest;
    const moved = isMoving(controller) || isPaused(controller) || this.words?.tone === 'move';
    this.#stop = { at: this.session.stopState.at, state: controller?.state, moved, job: this.isRunning };
    this.#did = '';
    await sent;
    this.#wordStop();
  }

  #wordStop(): void {
    const [stop, { phase, at }] = [this.#stop, this.session.stopState];
    if (!stop || phase !== 'sent' || at !== stop.at) return;
    const controller = this.latest;
    const since = performance.now() - stop.at;
    const waits = isMoving(controller) || (stop.state === 'Teaching' && controller?.state === 'Teaching') || since < 150;
    this.#did = stop.job && !stop.moved ? 'Stop was sent: the job ends before anything moves.' : whatStopDid(stop.state, stop.moved, controller, since);
    if (!waits || since > 4000) {
      this.#stop = undefined;
      setTimeout(() => {
        if (this.session.stopState.at === at) this.session.forgetStop();
      }, 8000);
    }
  }

  #take(status: Status): void {
    if (status.agent !== this.#agent) {
      this.#agent = status.agent;
      // A new agent has other jobs, so the page requests the current job.
      this.course = undefined;
      this.#stop = undefined;
      void this.refresh();
    }
    const controller = this.session.fresh ? (status.controller ?? undefined) : undefined;
    if (controller) this.#remember(controller);
    const before = this.latest;
    this.latest = controller;
    for (const frame of this.#frames) frame(controller);
    const now = performance.now();
    const turned = before?.state !== controller?.state || before?.trajectory !== controller?.trajectory;
    if (turned || now - this.#read >= READ_MS) {
      this.#read = now;
      this.controller = controller;
    }
    if (turned && (controller?.state === 'Init' || before?.state === 'Init')) void this.readInfo();
    this.#wordStop();
  }

  #lose(): void {
    this.latest = undefined;
    this.controller = undefined;
    // The plots show a gap here instead of a line.
    if (this.history.length > 0) this.history.push([Date.now() / 1000, ...new Array<number>(COLUMNS - 1).fill(NaN)]);
    for (const frame of this.#frames) frame(undefined);
  }

  #remember(controller: Controller): void {
    const row = new Float64Array(COLUMNS).fill(NaN);
    row[0] = Date.now() / 1000;
    controller.joints.forEach((joint, i) => {
      const commanded = controller.commanded_rad?.[i] ?? NaN;
      row[COLUMN.position + i] = joint.position_rad ?? NaN;
      row[COLUMN.velocity + i] = joint.velocity_rad_s ?? NaN;
      row[COLUMN.torque + i] = joint.torque_nm ?? NaN;
      row[COLUMN.temperature + i] = joint.temperature_c ?? NaN;
      row[COLUMN.commanded + i] = commanded;
      row[COLUMN.error + i] = commanded - (joint.position_rad ?? NaN);
    });
    this.history.push(row);
  }

  #receive({ event }: ArmEntry, isNew: boolean): void {
    const course = 'job' in event && this.course?.number === event.job ? this.course : undefined;
    switch (event.kind) {
      case 'begun':
        // The page shows the result of a Stop until the next job.
        if (isNew && !this.#stop) this.session.forgetStop();
        this.course = {
          number: event.job, what: event.what, client: event.client, phase: '', stage: 'begun', progress: 0, duration_s: 0, runs: 0,
          own: this.session.leasePhase === 'held' && event.client === this.session.name,
        };
        break;
      case 'uploading':
        if (course) Object.assign(course, { stage: 'uploading', phase: event.phase, progress: event.segments_done / Math.max(1, event.segments) });
        break;
      case 'executing':
        if (course) Object.assign(course, { stage: 'executing', phase: event.phase, progress: 0, duration_s: event.duration_s });
        break;
      case 'finished':
        if (course) Object.assign(course, { runs: event.runs, progress: 1 });
        break;
      case 'ended':
        if (course) Object.assign(course, { stage: 'ended', outcome: event.outcome });
        if (isNew) void this.#ended(event.job, event.outcome);
        break;
      case 'halt':
        if (isNew && this.session.leasePhase !== 'held') {
          this.session.toast({ tone: 'info', title: event.command === 'pause' ? 'Paused' : 'Stopped', text: `By ${event.by}.` });
        }
        break;
    }
  }

  async #ended(number: number, outcome: string): Promise<void> {
    try {
      const job = await this.session.api.get<JobObject>(`/api/jobs/${number}`);
      this.lastJob = job;
      const own = this.course?.number === number && this.course.own;
      if (!own || outcome === 'stopped') return;
      if (job.error) this.session.toast({ tone: 'error', title: jobWords(job.what), text: job.error.message, problem: job.error });
      else if (outcome === 'finished') this.session.toast({ tone: 'good', title: jobWords(job.what), text: 'Finished.' });
    } catch {
      // The page ignores an error: the log has the event, and the figures arrive with the next request for the
      // job.
    }
  }

  /** Reads data that the stream of the agent does not send. */
  async refresh(): Promise<void> {
    await Promise.all([this.readModel(), this.readInfo(), this.readPayload(), this.readPoses(), this.readTrajectories(), this.readJobs(), this.readSpeed()]);
  }

  async #quietly(act: () => Promise<void>): Promise<void> {
    try {
      await act();
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
    }
  }

  readModel(): Promise<void> {
    return this.#quietly(async () => {
      this.model = await this.session.api.get<ArmModel>('/api/arm/model');
    });
  }

  readInfo(): Promise<void> {
    return this.#quietly(async () => {
      const before = this.info?.hash;
      this.info = await this.session.api.get<InfoObject>('/api/info');
      if (before !== undefined && this.info.hash !== before) await this.readModel();
    });
  }

  readPayload(): Promise<void> {
    return this.#quietly(async () => {
      this.payload = await this.session.api.get<PayloadObject>('/api/payload');
    });
  }

  readPoses(): Promise<void> {
    return this.#quietly(async () => {
      try {
        this.poses = await this.session.api.get<Pose[]>('/api/poses');
        this.posesMissing = false;
      } catch (error) {
        this.posesMissing = error instanceof ApiError && error.isMissingPath;
        throw error;
      }
    });
  }

  readTrajectories(): Promise<void> {
    return this.#quietly(async () => {
      this.trajectories = await this.session.api.get<TrajectoryObject[]>('/api/trajectories');
    });
  }

  /**
   * Returns a free number for a new trajectory. If another client has used the number meanwhile, the agent refuses a
   * request that contains `new`.
   */
  async freeNumber(): Promise<number> {
    await this.readTrajectories();
    return freeNumber(this.trajectories);
  }

  readJobs(): Promise<void> {
    return this.#quietly(async () => {
      const jobs = await this.session.api.get<JobObject[]>('/api/jobs');
      this.lastJob = jobs.filter((job) => job.stage !== 'running').at(-1);
      const [course, runs] = [this.course, jobs.find((job) => job.stage === 'running')];
      if (course && course.stage !== 'ended' && jobs.some((job) => job.number === course.number && job.stage !== 'running')) course.stage = 'ended';
      if (runs && course?.number !== runs.number) {
        this.course = { number: runs.number, what: runs.what, client: runs.client, phase: '', stage: 'begun', progress: 0, duration_s: 0, runs: 0, own: false };
      }
    });
  }

  readSpeed(): Promise<void> {
    return this.#quietly(async () => {
      this.speed = (await this.session.api.get<{ percent: number }>('/api/speed')).percent;
    });
  }
}

export function provideArm(arm: ArmPage): void {
  setContext(KEY, arm);
  provideSession(arm.session);
}

export function useArm(): ArmPage {
  return getContext<ArmPage>(KEY);
}
