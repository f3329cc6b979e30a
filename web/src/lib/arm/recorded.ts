// Data of the flight recorder for plots: 1000 rows per second.
import type { LogValues } from './types.ts';

const COLUMNS = { position: 'position_rad', velocity: 'velocity_rad_s', torque: 'torque_nm', error: 'error_rad' } as const;

/** Quantities of the recorder that can be plotted. */
export type Recorded = keyof typeof COLUMNS;

export function isRecorded(quantity: string): quantity is Recorded {
  return quantity in COLUMNS;
}

/**
 * Returns the columns of a plot: the time, then a column for each joint (from 1), then the commanded values if
 * requested. All values are multiplied by `scale`.
 */
export function columnsOf(log: LogValues, quantity: Recorded, joints: readonly number[], scale: number, commanded: boolean): (number | null)[][] {
  const scaled = (column: readonly (number | null)[] | undefined) => (column ?? []).map((value) => (value === null ? null : value * scale));
  const of = (key: keyof LogValues['joints'][number]) => joints.map((joint) => scaled(log.joints[joint - 1]?.[key]));
  return [log.times_s, ...of(COLUMNS[quantity]), ...(commanded ? of('commanded_rad') : [])];
}
