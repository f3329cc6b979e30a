// Comparison of two arm files, and the gains in a file.
import { parse, type Table, type Value } from './toml.ts';

/** A difference between two arm files. */
export interface Difference {
  /** Position of the difference in the file, such as "joint 2, pid.kp". Joints are counted from 1. */
  place: string;
  board: string;
  file: string;
}

/**
 * Relative difference below which two values count as equal, because the controller's numbers have single precision.
 */
const SAME = 2e-6;
const NAMED = new Set(['joint', 'link']);

function same(a: Value | undefined, b: Value | undefined): boolean {
  if (typeof a === 'number' && typeof b === 'number') return a === b || Math.abs(a - b) <= SAME * Math.max(Math.abs(a), Math.abs(b), 1e-3);
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((value, i) => same(value, b[i]));
  return a === b;
}

function isTable(value: Value | undefined): value is Table {
  return typeof value === 'object' && !Array.isArray(value);
}

function isNumbers(value: Value | undefined): value is Value[] {
  return Array.isArray(value) && !value.some(isTable);
}

function flat(value: Value): number[] {
  return Array.isArray(value) ? value.flatMap(flat) : typeof value === 'number' ? [value] : [];
}

function shown(value: Value | undefined): string {
  if (value === undefined) return '–';
  if (typeof value === 'number') return String(Number(value.toPrecision(7)));
  if (typeof value === 'string' || typeof value === 'boolean') return String(value);
  if (!Array.isArray(value)) return Object.entries(value).map(([key, each]) => `${key} ${shown(each)}`).join(', ');
  const numbers = flat(value);
  return numbers.length > 8 ? `${numbers.length} numbers` : value.map(shown).join(', ');
}

function compare(board: Value | undefined, file: Value | undefined, place: string, out: Difference[]): void {
  if (same(board, file)) return;
  if (isTable(board) && isTable(file)) {
    for (const key of new Set([...Object.keys(board), ...Object.keys(file)])) {
      compare(board[key], file[key], place ? `${place}.${key}` : key, out);
    }
    return;
  }
  const tables = (value: Value | undefined) => value === undefined || (Array.isArray(value) && value.every(isTable));
  if (tables(board) && tables(file)) {
    const [a, b] = [(board ?? []) as Value[], (file ?? []) as Value[]];
    for (let i = 0; i < Math.max(a.length, b.length); i += 1) {
      const number = NAMED.has(place) ? (place === 'link' ? i : i + 1) : i + 1;
      compare(a[i], b[i], `${place} ${number}`, out);
    }
    return;
  }
  if (isNumbers(board) && isNumbers(file)) {
    const [a, b] = [flat(board), flat(file)];
    if (a.length === b.length && a.length > 8) {
      const differ = a.map((value, i) => Math.abs(value - (b[i] ?? 0)));
      const many = a.filter((value, i) => !same(value, b[i])).length;
      out.push({ place, board: `${a.length} numbers`, file: `${many} of them differ, by ${shown(Math.max(...differ))} at most` });
      return;
    }
  }
  out.push({ place: place.replaceAll(/ (\d+)\./g, ' $1, '), board: shown(board), file: shown(file) });
}

/** Keys that are never sent to the controller. A difference in these keys is not a difference of the arm. */
const NOT_GIVEN = new Set(['poses', 'format']);

/**
 * Returns the differences between two arm files in the data that the controller uses. Throws TomlError for invalid
 * TOML.
 */
export function differences(board: string, file: string): Difference[] {
  const [a, b] = [parse(board), parse(file)];
  for (const key of NOT_GIVEN) {
    delete a[key];
    delete b[key];
  }
  const out: Difference[] = [];
  compare(a, b, '', out);
  return out;
}

export interface Gains {
  kp: number;
  ki: number;
  kd: number;
}

/** The gains of each joint in an arm file. */
export function gainsOf(text: string): Gains[] {
  const joints = parse(text)['joint'];
  if (!Array.isArray(joints)) return [];
  return joints.slice(0, 6).map((joint) => {
    const pid = isTable(joint) ? joint['pid'] : undefined;
    const number = (key: string) => (isTable(pid) && typeof pid[key] === 'number' ? pid[key] : NaN);
    return { kp: number('kp'), ki: number('ki'), kd: number('kd') };
  });
}

/** Returns the file with other gains of a joint (counted from 1). All other text is unchanged, including comments. */
export function withGains(text: string, joint: number, gains: Gains): string {
  const parts = text.split(/^(?=\[\[joint\]\])/m);
  // The text before the first joint is a separate part, if it is not empty.
  const first = parts.findIndex((part) => part.startsWith('[[joint]]'));
  const at = first + joint - 1;
  const part = parts[at];
  if (first < 0 || part === undefined) throw new Error(`the file has no joint ${joint}`);
  let out = part;
  for (const [key, value] of Object.entries(gains)) {
    const before = out;
    out = out.replace(new RegExp(`(\\bpid\\s*=\\s*\\{[^}]*?\\b${key}\\s*=\\s*)[-+.\\deE_]+`), `$1${literal(value as number)}`);
    if (out === before && !new RegExp(`\\b${key}\\s*=`).test(before)) throw new Error(`joint ${joint} has no gain ${key} in this file`);
  }
  parts[at] = out;
  return parts.join('');
}

/** Returns a TOML number with a fraction. */
function literal(value: number): string {
  return Number.isInteger(value) ? value.toFixed(1) : String(value);
}
