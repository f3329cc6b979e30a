// Parser for the part of TOML that arm files use: tables, arrays of tables, inline tables, arrays over several
// lines, comments. The page uses the result for display and comparison only. The agent itself reads the arm files
// that are sent to the controller.

export type Value = string | number | boolean | Value[] | Table;
export interface Table {
  [key: string]: Value;
}

export class TomlError extends Error {
  readonly line: number;
  constructor(line: number, what: string) {
    super(`line ${line}: ${what}`);
    this.name = 'TomlError';
    this.line = line;
  }
}

class Reader {
  at = 0;
  readonly text: string;
  constructor(text: string) {
    this.text = text;
  }

  get line(): number {
    return this.text.slice(0, this.at).split('\n').length;
  }

  get end(): boolean {
    return this.at >= this.text.length;
  }

  peek(): string {
    return this.text.charAt(this.at);
  }

  /** Skips blanks and comments. If the value continues on the next line, also skips line ends. */
  skip(lines: boolean): void {
    for (; !this.end; this.at += 1) {
      const c = this.peek();
      if (c === '#') {
        while (!this.end && this.peek() !== '\n') this.at += 1;
        this.at -= 1;
      } else if (c === '\n' ? !lines : c !== ' ' && c !== '\t' && c !== '\r') return;
    }
  }

  take(expected: string): void {
    if (!this.text.startsWith(expected, this.at)) throw new TomlError(this.line, `${JSON.stringify(expected)} is expected`);
    this.at += expected.length;
  }

  key(): string[] {
    const keys: string[] = [];
    for (;;) {
      this.skip(false);
      if (this.peek() === '"' || this.peek() === "'") keys.push(this.string());
      else {
        const found = /^[A-Za-z0-9_-]+/.exec(this.text.slice(this.at, this.at + 200));
        if (!found) throw new TomlError(this.line, 'a name is expected');
        this.at += found[0].length;
        keys.push(found[0]);
      }
      this.skip(false);
      if (this.peek() !== '.') return keys;
      this.at += 1;
    }
  }

  string(): string {
    const quote = this.peek();
    const end = this.text.indexOf(quote, this.at + 1);
    let close = end;
    if (quote === '"') {
      close = this.at + 1;
      while (close < this.text.length && this.text[close] !== '"') close += this.text[close] === '\\' ? 2 : 1;
    }
    if (close < 0 || close >= this.text.length) throw new TomlError(this.line, 'a text has no end');
    const raw = this.text.slice(this.at + 1, close);
    this.at = close + 1;
    if (quote === "'") return raw;
    try {
      return JSON.parse(`"${raw}"`) as string;
    } catch {
      return raw;
    }
  }

  value(): Value {
    this.skip(true);
    const c = this.peek();
    if (c === '"' || c === "'") return this.string();
    if (c === '[') {
      this.at += 1;
      const out: Value[] = [];
      for (;;) {
        this.skip(true);
        if (this.peek() === ']') break;
        out.push(this.value());
        this.skip(true);
        if (this.peek() === ',') this.at += 1;
      }
      this.take(']');
      return out;
    }
    if (c === '{') {
      this.at += 1;
      const out: Table = {};
      for (;;) {
        this.skip(true);
        if (this.peek() === '}') break;
        this.pair(out);
        this.skip(true);
        if (this.peek() === ',') this.at += 1;
      }
      this.take('}');
      return out;
    }
    const found = /^[^\s,\]}#]+/.exec(this.text.slice(this.at, this.at + 100));
    const word = found?.[0] ?? '';
    this.at += word.length;
    if (word === 'true' || word === 'false') return word === 'true';
    const number = Number(word.replaceAll('_', '').replace('inf', 'Infinity'));
    if (word === '' || (Number.isNaN(number) && word !== 'nan')) throw new TomlError(this.line, `${JSON.stringify(word)} is no value`);
    return number;
  }

  pair(table: Table): void {
    const keys = this.key();
    this.skip(false);
    this.take('=');
    const value = this.value();
    const last = keys.pop() ?? '';
    descend(table, keys)[last] = value;
  }
}

function descend(table: Table, keys: readonly string[]): Table {
  let at = table;
  for (const key of keys) {
    const next = at[key];
    if (Array.isArray(next)) at = next.at(-1) as Table;
    else if (typeof next === 'object') at = next;
    else at = at[key] = {};
  }
  return at;
}

/** Parses TOML. Throws a TomlError that contains the line of the error. */
export function parse(text: string): Table {
  const reader = new Reader(text);
  const root: Table = {};
  let table = root;
  for (;;) {
    reader.skip(true);
    if (reader.end) return root;
    if (text.startsWith('[[', reader.at)) {
      reader.at += 2;
      const keys = reader.key();
      reader.take(']]');
      const last = keys.pop() ?? '';
      const parent = descend(root, keys);
      const list = Array.isArray(parent[last]) ? (parent[last] as Value[]) : (parent[last] = []);
      table = {};
      list.push(table);
    } else if (reader.peek() === '[') {
      reader.at += 1;
      const keys = reader.key();
      reader.take(']');
      table = descend(root, keys);
    } else reader.pair(table);
  }
}
