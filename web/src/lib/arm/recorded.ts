// A moment of the flight recorder, as it is plotted: 1000 rows a second.
import type { LogValues } from './types.ts';

const COLUMNS = { position: 'position_rad', velocity: 'velocity_rad_s', torque: 'torque_nm', error: 'error_rad' } as const;

/** What the recorder has and is plotted. */
export type Recorded = keyof typeof COLUMNS;

export function isRecorded(quantity: string): quantity is Recorded {
  return quantity in COLUMNS;
}

/** Time, then a column of each joint, from 1; behind them what was commanded, where that is asked for. Each value times `scale`. */
export function columnsOf(log: LogValues, quantity: Recorded, joints: readonly number[], scale: number, commanded: boolean): (number | null)[][] {
  const scaled = (column: readonly (number | null)[] | undefined) => (column ?? []).map((value) => (value === null ? null : value * scale));
  const of = (key: keyof LogValues['joints'][number]) => joints.map((joint) => scaled(log.joints[joint - 1]?.[key]));
  return [log.times_s, ...of(COLUMNS[quantity]), ...(commanded ? of('commanded_rad') : [])];
}
