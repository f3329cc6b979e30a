// Texts for the reports of boards and bus: state, cause, and next step.
import { count } from '../format.ts';
import type { EventTone, Tone } from '../tone.ts';
import type { BoardObject, ChainEvent, JobObject, Status } from './types.ts';

export function hex(value: number | null | undefined, digits = 2): string {
  return value == null ? '–' : `0x${value.toString(16).toUpperCase().padStart(digits, '0')}`;
}

/** Returns a list of boards as text, such as "board 3" or "boards 1, 2 and 7". */
export function boardList(numbers: readonly number[]): string {
  if (numbers.length === 0) return 'no board';
  if (numbers.length === 1) return `board ${numbers[0]}`;
  return `boards ${numbers.slice(0, -1).join(', ')} and ${numbers.at(-1)}`;
}

export interface BoardWords {
  tone: Tone;
  word: string;
  detail: string;
}

export function boardWords(board: BoardObject): BoardWords {
  if (board.state === 'lost' || board.heartbeat === 'lost') {
    return { tone: 'lost', word: 'Lost', detail: 'Its heartbeats stay away: it may still run. Check its power and the cable, then scan.' };
  }
  if (board.state === 'rebooted') {
    return { tone: 'error', word: 'Rebooted', detail: 'It began anew and has no number any more. Number the chain.' };
  }
  if (board.heartbeat === 'late') {
    return { tone: 'error', word: 'Late', detail: 'Its heartbeats have stayed away for more than 1.5 s.' };
  }
  switch (board.state) {
    case 'running':
      return board.active
        ? { tone: 'move', word: 'Running', detail: 'Its control loop runs, and its outputs are enabled: it may move.' }
        : { tone: 'pause', word: 'Outputs off', detail: 'Its control loop runs; its outputs are not enabled.' };
    case 'started':
      return { tone: 'hold', word: 'Started', detail: 'Its application is up; its control loop does not run.' };
    case 'programming':
      return { tone: 'teach', word: 'Programming', detail: 'It takes a new program.' };
    case 'exloader':
      return board.application
        ? { tone: 'off', word: 'Not started', detail: 'Its loader runs; the application is not started.' }
        : { tone: 'off', word: 'No program', detail: 'Its loader runs; there is no application to start. Update it.' };
    default:
      return { tone: 'off', word: 'Not known', detail: 'It has not answered since this agent began. Scan asks it.' };
  }
}

export type Step = 'scan' | 'init' | 'run' | 'doctor';

export interface BusWords {
  tone: Tone;
  word: string;
  detail: string;
  next: string;
  step?: Step;
}

/**
 * Returns the state of the bus and its boards as text. If there are several problems, the text describes the worst
 * problem.
 */
export function busWords(status: Status, boards: readonly BoardObject[], job: string | undefined): BusWords {
  const controller = status.controller;
  if (controller?.bus_off) {
    return {
      tone: 'error', word: 'Bus-off', detail: 'The CAN controller of this computer has left the bus: no frame gets through.',
      next: 'Check wiring, bit rate and the termination of 120 Ω at both ends.', step: 'doctor',
    };
  }
  if (status.competing_master) {
    return {
      tone: 'error', word: 'Competing master', detail: 'Another PC commands on this bus. Commands from here are refused.',
      next: 'End the program on the other PC.',
    };
  }
  if (status.shared_numbers.length > 0) {
    return {
      tone: 'error', word: 'Two boards with one number', detail: `${status.shared_numbers.join('; ')}.`,
      next: 'Number the chain anew. Until then only Stop works.', step: 'init',
    };
  }
  const are = (test: (board: BoardObject) => boolean) => boards.filter(test).map((board) => board.number);
  const verb = (numbers: number[]) => (numbers.length === 1 ? 'is' : 'are');
  const lost = are((board) => boardWords(board).tone === 'lost');
  if (lost.length > 0) {
    return {
      tone: 'error', word: lost.length === 1 ? `Board ${lost[0]} is lost` : `${lost.length} boards are lost`,
      detail: `No heartbeat of ${boardList(lost)} is received any more: ${lost.length === 1 ? 'it' : 'they'} may still run.`,
      next: 'Check power and cable, then scan.', step: 'scan',
    };
  }
  const rebooted = are((board) => board.state === 'rebooted');
  if (rebooted.length > 0) {
    return {
      tone: 'error', word: rebooted.length === 1 ? `Board ${rebooted[0]} has rebooted` : `${rebooted.length} boards have rebooted`,
      detail: `A board that begins anew has no number.`, next: 'Number the chain anew; this resets all boards.', step: 'init',
    };
  }
  const late = are((board) => board.heartbeat === 'late');
  if (late.length > 0) {
    return { tone: 'error', word: 'Heartbeat late', detail: `Heartbeats of ${boardList(late)} have stayed away for more than 1.5 s.`, next: '' };
  }
  if (controller?.passive) {
    return {
      tone: 'error', word: 'Errors on the bus', detail: 'The CAN controller of this computer is error passive: many frames are disturbed.',
      next: 'Check wiring, bit rate and termination.', step: 'doctor',
    };
  }
  if (boards.length === 0) {
    return job
      ? { tone: 'hold', word: 'Busy', detail: job, next: '' }
      : { tone: 'off', word: 'No boards known', detail: 'Boards without a number are seen by a scan alone.', next: 'Scan asks who is there and changes nothing; numbering then gives numbers along the wire.', step: 'scan' };
  }
  const active = are((board) => board.state === 'running' && board.active);
  const running = are((board) => board.state === 'running');
  const programming = are((board) => board.state === 'programming');
  const with_ = job ? `${job}. ` : '';
  if (programming.length > 0) {
    return { tone: 'teach', word: 'Programming', detail: `${with_}${boardList(programming).replace(/^b/, 'B')} ${verb(programming)} being programmed.`, next: '' };
  }
  if (active.length > 0) {
    const rest = running.length - active.length;
    return {
      tone: 'move', word: active.length === 1 ? 'One board is active' : `${active.length} boards are active`,
      detail: `${with_}Outputs of ${boardList(active)} are enabled: joints may move.${rest > 0 ? ` ${count(rest, 'other')} ${rest === 1 ? 'runs' : 'run'} with outputs off.` : ''}`, next: '',
    };
  }
  if (running.length > 0) {
    return {
      tone: 'pause', word: running.length === 1 ? 'One board runs' : `${running.length} boards run`,
      detail: `${with_}Control loops of ${boardList(running)} run; outputs are off, so nothing moves.`, next: 'Enable outputs of a board, or of all by Run.',
    };
  }
  const started = are((board) => board.state === 'started');
  if (started.length > 0) {
    return {
      tone: 'hold', word: started.length === 1 ? 'One board is started' : `${started.length} boards are started`,
      detail: `${with_}No control loop runs.`, next: job ? '' : 'Run starts control loops.', step: 'run',
    };
  }
  if (boards.every((board) => board.state === '?')) {
    return { tone: 'off', word: 'Boards not known', detail: `${with_}No board has answered yet.`, next: 'Scan asks who is there.', step: 'scan' };
  }
  return {
    tone: 'off', word: 'At rest', detail: `${with_}${count(boards.length, 'board')} ${boards.length === 1 ? 'has a number' : 'have numbers'}; no application runs.`,
    next: job ? '' : 'Run starts applications and control loops.', step: 'run',
  };
}

const JOBS: Record<string, string> = { scan: 'Scan', init: 'Numbering', run: 'Run', update: 'Update', doctor: 'Doctor' };

export function jobWords(what: string): string {
  return JOBS[what] ?? what.charAt(0).toUpperCase() + what.slice(1);
}

export const OUTCOMES: Record<string, string> = {
  'not-started': 'Not started: nothing was erased',
  cancelled: 'Cancelled before anything was erased',
  'up-to-date': 'Up to date: same program ID, and this image was written there before',
  'program-up-to-date': 'Same program ID, nothing sent: no record shows content and address',
  incomplete: 'Incomplete: erased or half written. Update it again; it has no program until then',
  unknown: 'Not known: nothing was received at the end. Scan, and look at its program ID',
  written: 'Written; nothing to verify it by',
  verified: 'Verified by reading back',
  running: 'The application runs',
};

/** Returns the result of a job in one sentence. */
export function jobResult(job: JobObject): string {
  if (job.error) return job.error.message;
  if (job.stage === 'cancelled') return 'Cancelled.';
  if (job.chain) {
    const found = job.chain.boards.length;
    const odd = job.chain.findings.length;
    return `${found === 0 ? 'No board has a number' : found === 1 ? 'One board has a number' : `${found} boards have numbers`}${odd > 0 ? `; ${count(odd, 'finding')}` : ''}.`;
  }
  if (job.findings) {
    const problems = job.findings.filter((finding) => finding.severity === 'problem').length;
    const warnings = job.findings.filter((finding) => finding.severity === 'warning').length;
    return problems + warnings === 0 ? 'Nothing is wrong.' : `${count(problems, 'problem')}, ${count(warnings, 'warning')}.`;
  }
  if (job.update) {
    if (job.update.dry_run) return 'The checks passed; nothing was written.';
    const done = job.update.boards.filter((board) => board.verified).map((board) => board.board);
    return done.length > 0 ? `Verified by reading back: ${boardList(done)}.` : 'Nothing was verified.';
  }
  if (job.run) return `${boardList(job.run.boards.map((board) => board.board)).replace(/^b/, 'B')} ${job.run.boards.length === 1 ? 'runs' : 'run'}.`;
  return job.stage === 'finished' ? 'Finished.' : job.stage === 'running' ? 'Goes on.' : 'Failed.';
}

/** Returns the result of a Stop as text, according to the confirmations of the boards. */
export function stoppedWords(event: Extract<ChainEvent, { kind: 'stopped' }>, ran = true): { text: string; failed: boolean; why: string } {
  const { boards, not_stopped } = event;
  const done = boards.length === 0 ? '' : ran ? `Stopped: ${boardList(boards)} confirmed it.` : `Stop was sent. No board was running; ${boardList(boards)} confirmed it.`;
  if (not_stopped.length > 0) {
    // The text lists only the boards, because the reasons are long and the next step must come
    // first.
    const which = not_stopped.map((each) => /^(board \d+):/.exec(each)?.[1] ?? each);
    const rest = boards.length === 0 ? 'No board confirmed it.' : `${count(boards.length, 'board')} confirmed it.`;
    return { text: `NOT STOPPED: ${which.join(', ')}. Use the emergency stop. ${rest}`, failed: true, why: not_stopped.join('; ') };
  }
  return { text: done || 'Stop was sent. No board was running.', failed: false, why: '' };
}

/** Returns an event as text. Undefined: the page does not show the event. */
export function eventWords(event: ChainEvent): { text: string; tone: EventTone; of: string } | undefined {
  const line = (text: string, tone: EventTone, of: string) => ({ text, tone, of });
  switch (event.kind) {
    case 'lease':
      return line(event.holder ? `${event.holder} commands` : 'Nobody commands', 'info', 'lease');
    case 'halt':
      return line(`Stop by ${event.by}${event.times ? `, ${event.times} times` : ''}`, 'warn', 'Stop');
    case 'stopped': {
      const { text, failed, why } = stoppedWords(event);
      return line(failed ? `${text} ${why}` : text, failed ? 'error' : 'good', 'Stop');
    }
    case 'heartbeat': {
      const words = { late: 'Heartbeat late', lost: 'Lost: no heartbeat for 3 s', back: 'Heartbeat is back', rebooted: 'Rebooted: it has no number any more' }[event.change] ?? event.change;
      return line(words, event.change === 'back' ? 'good' : event.change === 'late' ? 'warn' : 'error', event.board ? `board ${event.board}` : 'a board');
    }
    case 'loop': {
      const words = { 'left-loop': 'Left its control loop by itself', 'stopped-by-policy': 'Stopped, as another board was lost', 'in-loop': 'In its control loop again' }[event.change] ?? event.change;
      return line(words, event.change === 'in-loop' ? 'good' : event.change === 'left-loop' ? 'error' : 'warn', `board ${event.board}`);
    }
    case 'state': {
      const words: Record<string, string> = { exloader: 'Loader, application not started', started: 'Application started', running: 'Control loop runs', programming: 'Being programmed', '?': 'Not known' };
      return line(words[event.state] ?? event.state, 'info', `board ${event.board}`);
    }
    case 'board_error':
      return line(`${event.name} (${event.code}): ${event.meaning}`, 'error', event.board === 0 ? 'a board' : `board ${event.board}`);
    case 'text':
      return line(`Sends “${event.text}”`, 'info', `board ${event.board}`);
    case 'note':
      return line(event.text, 'warn', 'bus');
    case 'lost':
      return line(`The bus is gone: ${event.why}`, 'error', 'bus');
    case 'begun':
      return line(`${jobWords(event.what)}, by ${event.client}`, 'info', `job ${event.job}`);
    case 'job_note':
      return line(event.text, 'info', `job ${event.job}`);
    case 'progress':
      return undefined;
    case 'ended':
      return line(
        event.error ? `Ended: ${event.error.message}` : `Ended: ${event.outcome}`,
        event.outcome === 'finished' ? 'good' : event.outcome === 'cancelled' ? 'warn' : 'error', `job ${event.job}`,
      );
  }
}
