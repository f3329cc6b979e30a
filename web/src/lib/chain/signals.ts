// Inputs, outputs and parameters: names, ranges of sliders, and the format of values in a request.
import { number, parse } from '../format.ts';
import type { Value } from './types.ts';

/** Splits a name such as "position [0.01 deg]". Boards send the size of a step of the word in brackets. */
export function nameParts(name: string): { name: string; step: string } {
  const found = /^(.*?)\s*\[([^\]]*)\]\s*$/.exec(name);
  return found ? { name: found[1] ?? name, step: found[2] ?? '' } : { name, step: '' };
}

/**
 * Returns the unit of a value from the signal table. Without a table, returns the step size that the board has sent.
 */
export function unitWords(value: Value): string {
  if (value.unit) return value.unit;
  const { step } = nameParts(value.name);
  return step === '' ? '' : /^[\d.]/.test(step) ? `× ${step}` : step;
}

/** Returns a number in a text of the agent with a true minus sign. */
export function minus(text: string): string {
  return text.replace(/^-(?=[\d.])/, '\u2212');
}

export type Form = 'number' | 'switch' | 'word';

/** Returns the form in which the page sets a value. Bits of the signal table are not a number. */
export function formOf(value: Value): Form {
  if (typeof value.value === 'boolean') return 'switch';
  return typeof value.value === 'string' ? 'word' : 'number';
}

export interface Range {
  min: number;
  max: number;
  step: number;
  /** Source of the range: the signal table, the user, or no source. */
  by: 'table' | 'page' | 'nobody';
}

/** Returns a step that divides a range into about a thousand steps, and is not finer than one step of the word. */
export function stepOf(min: number, max: number, whole: boolean): number {
  const step = 10 ** Math.floor(Math.log10(Math.max(1e-9, (max - min) / 500)));
  return whole ? Math.max(1, step) : step;
}

const WORD = { min: -32768, max: 65535 };

/**
 * Returns the range of a slider. Without a signal table, this range is a small part of the range of a word, so that a
 * touch does not send the largest value.
 */
export function rangeOf(value: Value, chosen: { min: number; max: number } | undefined): Range {
  const whole = !value.unit;
  const of = (min: number, max: number, by: Range['by']): Range => ({ min, max, step: stepOf(min, max, whole), by });
  if (typeof value.min === 'number' && typeof value.max === 'number' && value.max > value.min) return of(value.min, value.max, 'table');
  if (chosen && chosen.max > chosen.min) return of(chosen.min, chosen.max, 'page');
  const now = typeof value.value === 'number' ? Math.abs(value.value) : 0;
  const reach = Math.max(whole ? 1000 : 100, now);
  return whole ? of(Math.max(WORD.min, -reach), Math.min(WORD.max, reach), 'nobody') : of(-reach, reach, 'nobody');
}

export function digitsOf(step: number): number {
  return Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)));
}

/** Returns a number with its unit, for display. */
export function text(value: number, step: number, unit: string | null | undefined): string {
  return `${number(value, digitsOf(step))}${unit ? ` ${unit}` : ''}`;
}

/**
 * Returns a number in the form that the agent expects. If the signal has a unit, the form contains the unit, because a
 * number without a unit could mean another value.
 */
export function given(value: number, step: number, unit: string | null | undefined): number | string {
  const plain = value.toFixed(digitsOf(step));
  return unit ? `${plain} ${unit}` : Number(plain);
}

/** Parses typed text: a number, or any other text that the agent accepts, such as 0x05DC, 15deg or on. */
export function typed(input: string, unit: string | null | undefined): number | string | undefined {
  const trimmed = input.trim();
  if (trimmed === '') return undefined;
  const value = /^0x/i.test(trimmed) ? NaN : parse(trimmed);
  if (!Number.isFinite(value)) return trimmed;
  return unit ? `${value} ${unit}` : value;
}
