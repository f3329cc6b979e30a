// Formats numbers with their units. For an unknown value, the page shows a dash and never an old
// value.

export const NONE = '–';
export const DEGREES = 180 / Math.PI;

/** Formats a number with a true minus sign, and without a negative zero. */
export function number(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text.replace('-', '\u2212');
}

export type AngleUnit = 'deg' | 'rad';

export function angle(rad: number | null | undefined, unit: AngleUnit): string {
  return unit === 'deg' ? number(rad == null ? rad : rad * DEGREES, 1) : number(rad, 3);
}

export function angleSign(unit: AngleUnit): string {
  return unit === 'deg' ? '°' : 'rad';
}

export function speedSign(unit: AngleUnit): string {
  return unit === 'deg' ? '°/s' : 'rad/s';
}

/** Converts an angle to the displayed unit. */
export function fromRad(rad: number, unit: AngleUnit): number {
  return unit === 'deg' ? rad * DEGREES : rad;
}

export function toRad(value: number, unit: AngleUnit): number {
  return unit === 'deg' ? value / DEGREES : value;
}

/** Parses a typed number. A decimal comma and a true minus sign are accepted. NaN: the text is invalid. */
export function parse(text: string): number {
  const plain = text.trim().replace('\u2212', '-').replace(',', '.');
  return plain === '' ? NaN : Number(plain);
}

/** Formats a duration, such as 4.2 s, 1:05 min or 2:03:10 h. */
export function duration(s: number | null | undefined): string {
  if (s === null || s === undefined || !Number.isFinite(s)) return NONE;
  if (s < 60) return `${s.toFixed(s < 10 ? 1 : 0)} s`;
  const whole = Math.round(s);
  const two = (n: number) => String(n).padStart(2, '0');
  const [h, m, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return h > 0 ? `${h}:${two(m)}:${two(rest)} h` : `${m}:${two(rest)} min`;
}

/** Formats a time in the browser's time zone, such as 14:03:27. */
export function clock(unix_s: number): string {
  return new Date(unix_s * 1000).toLocaleTimeString('en-GB', { hour12: false });
}

export function bytes(n: number): string {
  if (n < 1000) return `${n} B`;
  return n < 1e6 ? `${(n / 1000).toFixed(1)} kB` : `${(n / 1e6).toFixed(1)} MB`;
}

/** Returns a number with the noun in singular or plural, such as "one point" or "2 points". */
export function count(n: number, one: string, many = `${one}s`): string {
  return n === 1 ? `one ${one}` : `${n} ${many}`;
}
