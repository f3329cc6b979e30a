// Rows of waypoint files. Each row has the columns, units and separator of the file's header, so that the agent can
// read the row.
import { type ArmModel, flange, place, quaternion, rpy } from './kinematics.ts';

/** A pose that is added to the file as a row. */
export interface Waypoint {
  /** Joint positions, rad. */
  q: readonly number[];
  /** Name of the pose, if the pose has a name. */
  pose?: string | undefined;
}

/** A row, or the reason why the row cannot be added to the file. */
export type Row = { row: string } | { problem: string };
/** The waypoint file with the new row, or the reason why the row cannot be added. */
export type Added = { text: string; row: string } | { problem: string };

const JOINTS = ['q1', 'q2', 'q3', 'q4', 'q5', 'q6'];
const XYZ = ['x', 'y', 'z'];
const QUATERNION = ['qx', 'qy', 'qz', 'qw'];
const RPY = ['roll', 'pitch', 'yaw'];
const ANGLES = new Set([...JOINTS, ...RPY]);
/** Other names for the columns. */
const ALSO = new Map([['t', 't'], ['t_s', 't'], ['time', 't'], ['time_s', 't'], ['pose', 'pose'], ['name', 'pose'], ['leg', 'leg']]);
const LENGTHS = new Set([...XYZ, ...QUATERNION]);
/** Pattern of a number in a file. A text that does not match is the name of a column. */
const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;

interface Column {
  name: string;
  unit: 'rad' | 'deg' | undefined;
}

/** Returns the first line of a text that is neither blank nor a comment. */
function first(text: string): string | undefined {
  return text
    .replace(/^\uFEFF/, '')
    .split(/\r?\n/)
    .map((line) => line.trim())
    .find((line) => line !== '' && !line.startsWith('#'));
}

function cells(line: string): string[] {
  const separator = [';', ','].find((each) => line.includes(each));
  return (separator ? line.split(separator) : line.split(/\s+/)).map((cell) => cell.trim().replace(/^"+|"+$/g, ''));
}

function column(cell: string): Column | undefined {
  const lower = cell.toLowerCase();
  const plain = ALSO.get(lower) ?? lower.replace(/_m$/, '');
  if (ALSO.has(lower) || LENGTHS.has(plain)) return { name: plain, unit: undefined };
  const [, name = lower, unit] = /^(.*)_(rad|deg)$/.exec(lower) ?? [];
  return ANGLES.has(name) ? { name, unit: unit as Column['unit'] } : undefined;
}

/** Returns `true` if the header contains the unit of an angle. If the header contains units, the switch for degrees has no effect. */
export function namesUnits(text: string): boolean {
  if (isJson(text)) return /"(q[1-6]|roll|pitch|yaw)_deg"/.test(text);
  return cells(first(text) ?? '').some((cell) => column(cell)?.unit !== undefined);
}

function isJson(text: string): boolean {
  return /^[\s\uFEFF]*[[{]/.test(text);
}

/**
 * Returns the waypoint as a row below the header of `text`. `degrees`: numbers without a unit in the header are
 * degrees. `model`: needed for poses of the flange.
 */
export function rowFor(text: string, waypoint: Waypoint, degrees: boolean, model?: ArmModel): Row {
  if (isJson(text)) return { problem: 'These waypoints are JSON. Rows can be added to a table (CSV) only.' };
  const header = first(text);
  if (header === undefined) return rowFor(JOINTS.join(','), waypoint, degrees, model);
  const names = cells(header);
  if (names.every((cell) => NUMBER.test(cell))) return { problem: `The table has no header. Write ${JOINTS.join(',')} above the first row; add _deg to each name for degrees.` };
  const columns: Column[] = [];
  for (const name of names) {
    const found = column(name);
    if (!found) return { problem: `The header has a column "${name}", which a waypoint cannot fill.` };
    if (columns.some((each) => each.name === found.name)) return { problem: `The header has the column ${found.name} twice.` };
    columns.push(found);
  }
  // The cells of `t` and `leg` stay empty. An empty `t` means no time. If `leg` is empty, the switch for straight lines
  // decides.
  const filled = valuesFor(new Set(columns.map((each) => each.name)), waypoint, model);
  if ('problem' in filled) return filled;
  const out = columns.map(({ name, unit }) => {
    const value = filled.values[name];
    if (value === undefined || typeof value === 'string') return value ?? '';
    const inDegrees = ANGLES.has(name) && (unit === undefined ? degrees : unit === 'deg');
    return (inDegrees ? (value * 180) / Math.PI : value).toFixed(6);
  });
  // If the separator is a space, a cell cannot be empty, so commas are used.
  const separator = /[;,]\s*/.exec(header)?.[0].replace(/\s+/, ' ') ?? (out.includes('') ? ',' : ' ');
  return { row: out.join(separator).trim() };
}

/**
 * Returns the values for the columns: the joint positions, otherwise the name of the pose, otherwise the pose of the
 * flange.
 */
function valuesFor(has: Set<string>, waypoint: Waypoint, model: ArmModel | undefined): { values: Record<string, number | string> } | { problem: string } {
  const lacks = (names: readonly string[]) => names.filter((name) => !has.has(name));
  const any = (names: readonly string[]) => lacks(names).length < names.length;
  const missing = (names: readonly string[]) => ({ problem: `The header lacks ${names.join(', ')}: a waypoint cannot be written without ${names.length === 1 ? 'it' : 'them'}.` });
  if (any(JOINTS)) {
    if (lacks(JOINTS).length > 0) return missing(lacks(JOINTS));
    return { values: Object.fromEntries(JOINTS.map((name, i) => [name, waypoint.q[i] ?? NaN])) };
  }
  if (has.has('pose') && waypoint.pose !== undefined) return { values: { pose: waypoint.pose } };
  if (!any([...XYZ, ...QUATERNION, ...RPY])) {
    return has.has('pose')
      ? { problem: 'This file has poses by their names only. Save the current position as a pose first, then add it here.' }
      : missing(JOINTS);
  }
  const orientation = lacks(QUATERNION).length === 0 ? QUATERNION : any(RPY) || !any(QUATERNION) ? RPY : QUATERNION;
  const without = lacks([...XYZ, ...orientation]);
  if (without.length > 0) return missing(without);
  if (!model) return { problem: 'The arm model is not known yet, so the pose of the flange is not. Try again when the 3D view shows the arm.' };
  const frame = flange(model, waypoint.q);
  const numbers = [...place(frame), ...(orientation === RPY ? rpy(frame) : quaternion(frame))];
  return { values: Object.fromEntries([...XYZ, ...orientation].map((name, i) => [name, numbers[i] ?? NaN])) };
}

/** Returns the file with a row for the waypoint as its last row. A file without a header gets a header. */
export function withRow(text: string, waypoint: Waypoint, degrees: boolean, model?: ArmModel): Added {
  const made = rowFor(text, waypoint, degrees, model);
  if ('problem' in made) return made;
  const before = [text.trimEnd(), first(text) === undefined ? JOINTS.join(',') : ''].filter((part) => part !== '');
  return { text: [...before, made.row, ''].join('\n'), row: made.row };
}
