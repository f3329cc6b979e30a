// Tests of gains: a joint moves a step and back; its errors meanwhile, next to those of earlier tests.
import type { Gains } from './armfile.ts';
import type { JointResult } from './types.ts';

export interface Figures {
  max: number;
  rms: number;
}

export interface Trial {
  joint: number;
  gains: Gains;
  /** s since 1970. */
  start: number;
  times: number[];
  /** rad; null if unknown. */
  errors: (number | null)[];
  figures: Figures | undefined;
}

/** The worse of two motions. */
export function figuresOf(result: JointResult | undefined, before: Figures | undefined): Figures | undefined {
  const [max, rms] = [result?.max_error_mrad, result?.rms_error_mrad];
  if (typeof max !== 'number' || typeof rms !== 'number') return before;
  return { max: Math.max(max, before?.max ?? 0), rms: Math.max(rms, before?.rms ?? 0) };
}

/** The errors of several tests over the time since each one's first motion, mrad, as columns with one time. */
export function overlay(trials: readonly Trial[]): (number | null)[][] {
  const rows = new Map<number, (number | null)[]>();
  trials.forEach((trial, k) => {
    const first = trial.times[trial.errors.findIndex((error) => error !== null)] ?? trial.start;
    trial.times.forEach((time, i) => {
      const error = trial.errors[i];
      if (error == null) return;
      // At least 40 ms apart: rounded to that, tests share their times.
      const at = Math.round((time - first) / 0.04) * 0.04;
      const row = rows.get(at) ?? new Array<number | null>(trials.length).fill(null);
      row[k] = error * 1000;
      rows.set(at, row);
    });
  });
  const times = [...rows.keys()].sort((a, b) => a - b);
  return [times, ...trials.map((_, k) => times.map((time) => rows.get(time)?.[k] ?? null))];
}
