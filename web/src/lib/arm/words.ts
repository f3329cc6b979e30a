// Texts for the reports of the controller: state, cause, and next step.
import type { Controller, ArmEvent, InfoObject } from './types.ts';
import { count, duration } from '../format.ts';
import type { EventTone, Tone } from '../tone.ts';

export type Step = 'recover' | 'acknowledge' | 'which-arm' | 'resume' | 'teach-off' | 'give-arm' | 'run' | 'token' | 'bench';

export interface Cause {
  words: string;
  /** Code that `jtc explain` accepts. */
  code: string;
}

export interface StateWords {
  tone: Tone;
  word: string;
  /** Reason why the arm does not move, or the current action of the arm. */
  detail: string;
  causes: Cause[];
  /** Next step as text, and the action of the button for this step. */
  next: string;
  step?: Step;
}

function sentence(words: string): string {
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/**
 * Returns the current errors, the most specific first: the cause of a held stop, then the error bits. `explain` accepts
 * each of them unchanged.
 */
export function causesOf(controller: Controller): Cause[] {
  const stop = controller.held_stop;
  const found = stop ? [{ words: sentence(stop.text), code: stop.code }] : [];
  return [...found, ...controller.causes.map((words) => ({ words: sentence(words), code: words }))];
}

/** Returns the next step after a held stop, in the words that the agent sends. */
function afterHeldStop({ held_stop: stop }: Controller): string {
  if (!stop) return 'Remove what it met, or set its payload, then acknowledge. Nothing moves until then.';
  const remedy = sentence(stop.remedy);
  return stop.kind === 'encoder-jump' ? `${remedy}.` : `${remedy}, then acknowledge. Nothing moves until then.`;
}

/** Returns the joints that are declared absent. Under torque, only the drives of absent joints are in Start. */
export function absent(controller: Controller): number[] {
  const powered = ['HoldPos', 'Operate', 'Teaching'].includes(controller.state);
  return powered ? controller.joints.filter((joint) => joint.state === 'Start').map((joint) => joint.joint) : [];
}

export function hasTorque(controller: Controller | null | undefined): boolean {
  return controller != null && ['HoldPos', 'Operate', 'Teaching'].includes(controller.state);
}

/**
 * Returns the numbers of the drives that are not enabled yet, counted from 1. The controller holds the position with
 * the enabled drives.
 */
export function enabling(controller: Controller): number[] {
  return controller.joints.filter((joint) => joint.state !== 'OperationEnable' && joint.state !== 'Start').map((joint) => joint.joint);
}

/** Returns true if the controller has stopped the arm because of an error and holds it under torque (J-69). */
export function isHeldStop(controller: Controller): boolean {
  return hasTorque(controller) && controller.error_codes.join() === 'internal-joint-error';
}

/** Returns true if teaching can begin in this state. Teaching can begin in a held stop. */
export function canBeTaught(controller: Controller | null | undefined): boolean {
  return controller != null && controller.state === 'HoldPos' && enabling(controller).length === 0;
}

/** Returns true if a motion can begin. A motion can begin only if the controller holds every joint that is not absent. */
export function isHeld(controller: Controller | null | undefined): boolean {
  return controller != null && controller.state === 'HoldPos' && enabling(controller).length === 0 && controller.errors.length === 0;
}

export function isMoving(controller: Controller | null | undefined): boolean {
  return controller != null && controller.trajectory === 'Execute' && controller.state === 'Operate';
}

export function isPaused(controller: Controller | null | undefined): boolean {
  return controller != null && controller.trajectory === 'Pause';
}

/**
 * Returns the reason why no joint can be jogged. Empty: joints can be jogged. `job` is the running job and its stage.
 */
export function noJog(controller: Controller | undefined, job?: { what: string; stage: 'begun' | 'uploading' | 'executing' }): string {
  if (!controller) return 'The state of the arm is not known.';
  if ((controller.state === 'HoldPos' || controller.state === 'Operate') && controller.errors.length === 0) {
    const stop = 'or press Stop';
    if (isPaused(controller)) return `A motion is paused. Resume it and wait until it has ended, ${stop}.`;
    // Only older controllers report TransNullToStop.
    if (job?.stage === 'uploading' || controller.trajectory === 'TransNullToStop') return `A motion is being uploaded. Wait until it has ended, ${stop}.`;
    if (job) return `${jobWords(job.what)} is ${job.stage === 'begun' ? 'being prepared' : 'running'}. Wait until it has ended, ${stop}.`;
    if (isMoving(controller)) return `A motion is running. Wait until it has ended, ${stop}.`;
  }
  if (isHeld(controller)) return '';
  const { word, detail, next } = stateWords(controller, undefined, []);
  return `Jogging needs the arm to hold position. ${word}: ${next || detail}`;
}

/**
 * Returns the question that the page asks before a controller without parameters uses its defaults. The text explains
 * the origin of the defaults, and the risk if the arm is a different arm.
 */
export function defaultsWords(info: Pick<InfoObject, 'arm' | 'defaults_stored'> | undefined, simulated: boolean): { question: string; used: string; risk: string; button: string } {
  const name = info?.arm || 'the built-in arm';
  const [stored, known] = [info?.defaults_stored ?? false, name === info?.arm];
  const which = stored || !known ? name : `${/^[aeiou]/i.test(name) ? 'an' : 'a'} ${name}`;
  const button = `Recover as ${name}`;
  const kept = stored ? 'the masses, friction and gains that are stored in it' : 'its built-in masses, friction and gains';
  if (simulated) return { question: `Is this ${which}?`, used: `The controller is simulated. It uses ${kept}.`, risk: '', button };
  return {
    question: `Is this ${which}?`,
    used: `The controller uses ${kept} under torque.`,
    risk: 'On another arm, gravity compensation and gains are wrong: the arm can fall or swing.',
    button,
  };
}

/** Returns the speed of the fastest joint, rad/s. */
export function fastest(controller: Controller): number {
  return Math.max(...controller.joints.map((joint) => Math.abs(joint.velocity_rad_s ?? 0)));
}

const MOVES_RAD_S = 0.01;

/**
 * Returns the texts of a state. `job` is the current job as text. `missing` are the parameters that the controller
 * lacks.
 */
export function stateWords(controller: Controller, job: string | undefined, missing: readonly string[]): StateWords {
  const causes = causesOf(controller);
  const base = { causes, next: '' };
  if (isHeldStop(controller) && controller.state === 'Teaching') {
    return {
      ...base, tone: 'teach', word: 'Teaching', detail: `The arm can be led by hand. A held stop is not acknowledged: ${causes[0]?.words ?? ''}.`,
      next: 'End teaching, then acknowledge.', step: 'teach-off',
    };
  }
  if (isHeldStop(controller)) {
    return {
      ...base, tone: 'error', word: 'Held stop', detail: `${causes[0]?.words ?? 'The controller stopped the arm'}. The arm is held.`,
      next: afterHeldStop(controller), step: 'acknowledge',
    };
  }
  if (controller.state === 'Error' || causes.length > 0) {
    const first = causes[0]?.words ?? 'an error that is over';
    const torque = controller.state === 'Error' ? 'All torques are off.' : '';
    return {
      ...base, tone: 'error', word: 'Error', detail: `${first}. ${torque}`.trim(),
      next: 'Remove the cause, then recover: errors are cleared, and the arm is held where it is.', step: 'recover',
    };
  }
  switch (controller.state) {
    case 'Start':
    case 'Init': {
      const lacks = missing.length > 0;
      return {
        ...base, tone: 'off', word: 'No torque',
        detail: lacks ? `The controller has not been given: ${missing.join(', ')}.` : 'The controller brings up its drives, or waits for them.',
        next: lacks ? 'Recover asks first which arm this is.' : 'Recover enables the drives and holds the arm.',
        step: lacks ? 'which-arm' : 'recover',
      };
    }
    case 'Teaching':
      return { ...base, tone: 'teach', word: 'Teaching', detail: 'Gravity is compensated: the arm can be led by hand.', next: 'End teaching to hold the arm.', step: 'teach-off' };
    case 'Operate':
      if (isPaused(controller)) {
        return { ...base, tone: 'pause', word: 'Paused', detail: job ? `${job} stands on its path.` : 'The motion stands on its path.', next: 'Resume goes on; Stop ends the motion.', step: 'resume' };
      }
      return { ...base, tone: 'move', word: 'Moving', detail: job ?? 'A trajectory is executed.', next: '' };
    case 'HoldPos': {
      if (isPaused(controller)) {
        return { ...base, tone: 'pause', word: 'Paused', detail: job ? `${job} stands on its path.` : 'The motion stands on its path.', next: 'Resume goes on; Stop ends the motion.', step: 'resume' };
      }
      const late = enabling(controller);
      if (late.length > 0) {
        const which = late.length === controller.joints.length ? 'The drives are' : `The ${late.length === 1 ? 'drive of joint' : 'drives of joints'} ${late.join(', ')} ${late.length === 1 ? 'is' : 'are'}`;
        return { ...base, tone: 'off', word: 'Enabling', detail: `${which} being enabled.`, next: '' };
      }
      const gone = absent(controller);
      if (gone.length > 0) {
        const names = gone.join(', ');
        return { ...base, tone: 'hold', word: 'Holding', detail: `Set absent: ${gone.length === 1 ? 'joint' : 'joints'} ${names}. No motion is executed.`, next: 'Joints that are there can be jogged.' };
      }
      const jumped = controller.encoder_jumped ?? [];
      if (jumped.length > 0) {
        const names = `${jumped.length === 1 ? 'joint' : 'joints'} ${jumped.join(', ')}`;
        return { ...base, tone: 'hold', word: 'Holding', detail: `Encoder jumped: ${names}. No trajectory is executed.`, next: `${sentence(controller.next)}.` };
      }
      if (fastest(controller) > MOVES_RAD_S) return { ...base, tone: 'move', word: 'Moving', detail: job ?? 'Joints are jogged.', next: '' };
      return { ...base, tone: 'hold', word: 'Holding', detail: job ?? 'The arm is held, and can be moved.', next: '' };
    }
    default:
      return { ...base, tone: 'off', word: controller.state, detail: controller.next, next: '' };
  }
}

/**
 * Returns the effect of a Stop as text. The effect follows from the state when the user touched Stop and from the
 * current state.
 */
export function whatStopDid(before: string | undefined, wasMoving: boolean, now: Controller | undefined | null, tookMs: number): string {
  const took = `${(tookMs / 1000).toFixed(1)} s`;
  if (!now) return 'Stop was sent. No status has come since.';
  const held = now.state === 'HoldPos' ? 'the arm is held' : now.state === 'Init' || now.state === 'Error' || now.state === 'Start' ? 'there is no torque' : `state ${now.state}`;
  if (before === 'Teaching') return now.state === 'Teaching' ? 'Stop was sent.' : `Teaching ended; ${held}.`;
  if (!wasMoving) return `Stop was sent. Nothing was moving; ${held}.`;
  return isMoving(now) ? 'Stop was sent: the arm decelerates on its path.' : `Stopped on the path in ${took}; ${held}.`;
}

/** Returns a sentence about a job. `what` is the name of the job in events, such as "recover". */
export function jobWords(what: string): string {
  return sentence(what);
}

/** Returns an event as text. Undefined: the page does not show the event. */
export function eventWords(event: ArmEvent): { text: string; tone: EventTone; of: string } | undefined {
  const of = 'job' in event ? `job ${event.job}` : '';
  const line = (text: string, tone: EventTone = 'info', whose = of) => ({ text, tone, of: whose });
  switch (event.kind) {
    case 'lease':
      return line(event.holder ? `${event.holder} commands` : 'Nobody commands', 'info', 'lease');
    case 'halt':
      return line(`${event.command === 'pause' ? 'Pause' : 'Stop'} by ${event.by}`, 'warn', 'halt');
    case 'state': {
      const errors = event.errors.length > 0 ? `: ${event.errors.join(', ')}` : '';
      return line(`State ${event.state}, trajectory ${event.trajectory}${errors}`, event.errors.length > 0 ? 'error' : 'info', 'state');
    }
    case 'lost':
      return line(`The port is gone: ${event.why}`, 'error', 'port');
    case 'begun':
      return line(`${jobWords(event.what)}, by ${event.client}`);
    case 'note':
      return line(event.text);
    case 'checked':
      return line(`${jobWords(event.phase)} checked: ${count(event.points, 'point')}, ${duration(event.duration_s)}${event.warnings.map((w) => `; ${w}`).join('')}`, event.warnings.length > 0 ? 'warn' : 'info');
    case 'uploading':
      return undefined;
    case 'uploaded':
      return line(`${jobWords(event.phase)} uploaded in ${duration(event.time_s)}`);
    case 'given':
      return line(`Confirmed: ${event.parameter}`);
    case 'executing':
      return line(`${jobWords(event.phase)} is executed: ${duration(event.duration_s)}`);
    case 'moving':
      return undefined;
    case 'finished':
      return line(`Motion ${event.runs} finished`, 'good');
    case 'ended':
      return line(
        event.error ? `Ended: ${event.error.message}` : `Ended: ${event.outcome}`,
        event.outcome === 'finished' ? 'good' : event.outcome === 'stopped' ? 'warn' : 'error',
      );
  }
}
