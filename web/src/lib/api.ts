// Requests to an agent, and what its refusals say. Free of what the agent drives: the pages of an arm and of a chain share it.

/** Why something was not done, as agents answer it. */
export interface Problem {
  code: string;
  message: string;
  next: string;
  cause?: string | null;
  joint?: number | null;
  point?: number | null;
  value?: number | null;
  limit?: number | null;
}

/** A request that was not done. */
export class ApiError extends Error {
  readonly status: number;
  readonly problem: Problem;

  constructor(status: number, problem: Problem) {
    super(problem.message);
    this.name = 'ApiError';
    this.status = status;
    this.problem = problem;
  }

  /** The agent does not know this path: it is older than the page. */
  get isMissingPath(): boolean {
    return this.status === 405 || (this.status === 404 && this.problem.code === 'no-such-path');
  }

  /** Nobody was let in with this token, or without one. */
  get wantsToken(): boolean {
    return this.status === 401 || this.status === 403;
  }

  /** No answer came at all. */
  get isNoConnection(): boolean {
    return this.status === 0;
  }
}

export type Query = Record<string, string | number | undefined>;

export interface Ask {
  query?: Query;
  body?: unknown;
  /** Longest time for the answer, ms. */
  within?: number;
  /** Outlives the page: for what is sent while it closes. */
  keepalive?: boolean;
  /** Waits for no other request: Stop, Pause, and what a key is held for. */
  ahead?: boolean;
  /** Without the token. */
  bare?: boolean;
}

/** So many requests are open at once beside those that go ahead: a browser opens six to one agent, and lets the next wait without a word. */
export const OPEN_MAX = 3;

type Fetch = (input: string, init: RequestInit) => Promise<Response>;

/** The path with its query; parts that are undefined are left out. */
export function address(path: string, query: Query = {}): string {
  const parts = Object.entries(query).filter((entry): entry is [string, string | number] => entry[1] !== undefined);
  if (parts.length === 0) return path;
  return `${path}?${parts.map(([key, value]) => `${encodeURIComponent(key)}=${encodeURIComponent(value)}`).join('&')}`;
}

/** The refusal in an answer, whatever form it has. */
export function problemOf(status: number, text: string): Problem {
  try {
    const value: unknown = JSON.parse(text);
    if (typeof value === 'object' && value !== null && 'message' in value && 'code' in value) {
      return { ...(value as Problem), next: (value as Problem).next ?? '' };
    }
  } catch {
    // Not JSON: answered by something in between, or by a router that knows no such path.
  }
  if (status === 404) {
    return {
      code: 'no-such-path',
      message: 'This agent does not offer that.',
      cause: 'It is older than this page.',
      next: 'Update the agent (--version shows what runs).',
    };
  }
  if (status === 408 || status === 504) {
    return { code: 'timeout', message: 'The agent took too long to answer.', next: 'Try again.' };
  }
  return { code: `http-${status}`, message: text.trim() || `The agent answered ${status}.`, next: 'Try again.' };
}

interface Waiting {
  reads: boolean;
  go(): void;
  drop(): void;
}

/** A client of an agent's API. */
export class Api {
  #open = 0;
  #waiting: Waiting[] = [];
  readonly #token: () => string | undefined;
  readonly #key: () => string | undefined;
  readonly #fetch: Fetch;

  constructor(token: () => string | undefined, key: () => string | undefined, fetch?: Fetch) {
    this.#token = token;
    this.#key = key;
    this.#fetch = fetch ?? ((input, init) => globalThis.fetch(input, init));
  }

  /** What waits for its turn and is no question is not sent any more. */
  recall(): void {
    const commands = this.#waiting.filter((each) => !each.reads);
    this.#waiting = this.#waiting.filter((each) => each.reads);
    for (const command of commands) command.drop();
  }

  /** Sends, and returns the answer as it came. Throws ApiError for everything else. */
  async send(method: string, path: string, ask: Ask = {}): Promise<Response> {
    if (ask.ahead || ask.keepalive) return this.#send(method, path, ask);
    if (this.#open >= OPEN_MAX) await this.#turn(method === 'GET');
    else this.#open += 1;
    try {
      return await this.#send(method, path, ask);
    } finally {
      // Whoever is next has this place.
      const next = this.#waiting.shift();
      if (next) next.go();
      else this.#open -= 1;
    }
  }

  #turn(reads: boolean): Promise<void> {
    return new Promise((go, fail) => {
      const drop = () => fail(new ApiError(0, { code: 'stopped', message: 'A Stop came before it was sent; nothing was sent.', next: 'Ask for it again.' }));
      this.#waiting.push({ reads, go, drop });
    });
  }

  async #send(method: string, path: string, ask: Ask): Promise<Response> {
    const headers: Record<string, string> = {};
    const token = ask.bare ? undefined : this.#token();
    const key = this.#key();
    if (token) headers['Authorization'] = `Bearer ${token}`;
    if (key && method !== 'GET') headers['Lease-Key'] = key;
    const init: RequestInit = { method, headers, cache: 'no-store' };
    if (ask.body !== undefined) {
      headers['Content-Type'] = 'application/json';
      init.body = JSON.stringify(ask.body);
    }
    if (ask.keepalive) init.keepalive = true;
    init.signal = AbortSignal.timeout(ask.within ?? 15_000);
    let response: Response;
    try {
      response = await this.#fetch(address(path, ask.query), init);
    } catch (error) {
      const late = error instanceof DOMException && error.name === 'TimeoutError';
      throw new ApiError(0, {
        code: late ? 'timeout' : 'no-connection',
        message: late ? 'The agent did not answer in time.' : 'The agent cannot be reached.',
        cause: 'The agent has ended, or the network to it is interrupted.',
        next: 'Check the network and that the agent runs. The emergency stop works without either.',
      });
    }
    if (!response.ok) throw new ApiError(response.status, problemOf(response.status, await response.text()));
    return response;
  }

  async json<T>(method: string, path: string, ask: Ask = {}): Promise<T> {
    const response = await this.send(method, path, ask);
    const text = await response.text();
    return (text === '' ? undefined : JSON.parse(text)) as T;
  }

  get<T>(path: string, query?: Query): Promise<T> {
    return this.json<T>('GET', path, query ? { query } : {});
  }
}
