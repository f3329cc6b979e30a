// Tests of gains. A joint moves by a step and back, and the page compares the errors of the joint with the errors
// of earlier tests.
import type { Gains } from './armfile.ts';
import type { JointResult } from './types.ts';

export interface Figures {
  max: number;
  rms: number;
}

export interface Trial {
  joint: number;
  gains: Gains;
  /** Start of the test, s since 1970. */
  start: number;
  times: number[];
  /** Position errors, rad; null if unknown. */
  errors: (number | null)[];
  figures: Figures | undefined;
}

/** Returns the worse of the figures of two motions. */
export function figuresOf(result: JointResult | undefined, before: Figures | undefined): Figures | undefined {
  const [max, rms] = [result?.max_error_mrad, result?.rms_error_mrad];
  if (typeof max !== 'number' || typeof rms !== 'number') return before;
  return { max: Math.max(max, before?.max ?? 0), rms: Math.max(rms, before?.rms ?? 0) };
}

/**
 * Returns the errors of several tests in mrad, as columns with a common time. The time counts from the first motion of
 * each test.
 */
export function overlay(trials: readonly Trial[]): (number | null)[][] {
  const rows = new Map<number, (number | null)[]>();
  trials.forEach((trial, k) => {
    const first = trial.times[trial.errors.findIndex((error) => error !== null)] ?? trial.start;
    trial.times.forEach((time, i) => {
      const error = trial.errors[i];
      if (error == null) return;
      // Samples are at least 40 ms apart. The code rounds times to 40 ms, so that the tests have common times.
      const at = Math.round((time - first) / 0.04) * 0.04;
      const row = rows.get(at) ?? new Array<number | null>(trials.length).fill(null);
      row[k] = error * 1000;
      rows.set(at, row);
    });
  });
  const times = [...rows.keys()].sort((a, b) => a - b);
  return [times, ...trials.map((_, k) => times.map((time) => rows.get(time)?.[k] ?? null))];
}
