// Requests to an agent, and refusals of the agent. The pages of an arm and of a chain share this code, which does not
// depend on the controlled device.

/** Reason why the agent refused a request, in the format of the agent's answer. */
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

/** A failed request. */
export class ApiError extends Error {
  readonly status: number;
  readonly problem: Problem;

  constructor(status: number, problem: Problem) {
    super(problem.message);
    this.name = 'ApiError';
    this.status = status;
    this.problem = problem;
  }

  /** True if the agent does not know this path, because it is older than the page. */
  get isMissingPath(): boolean {
    return this.status === 405 || (this.status === 404 && this.problem.code === 'no-such-path');
  }

  /** True if the agent refused the token, or a request without a token. */
  get wantsToken(): boolean {
    return this.status === 401 || this.status === 403;
  }

  /** True if no answer arrived. */
  get isNoConnection(): boolean {
    return this.status === 0;
  }
}

export type Query = Record<string, string | number | undefined>;

export interface Ask {
  query?: Query;
  body?: unknown;
  /** Longest time until the answer arrives, ms. */
  within?: number;
  /** True: the request continues after the page has closed. */
  keepalive?: boolean;
  /** True: the request is sent without waiting for other requests. Used for Stop, Pause, and held keys. */
  ahead?: boolean;
  /** True: the request is sent without the token. */
  bare?: boolean;
  /** True: the request moves nothing, so a Stop does not drop the request from the queue. */
  ends?: boolean;
  /** True: the request is cancelled if a Stop needs its connection. */
  yields?: boolean;
}

/**
 * Largest number of open requests, in addition to requests with `ahead`. A browser opens six connections to one agent, and
 * silently queues further requests.
 */
export const OPEN_MAX = 3;
/**
 * Longest time for which a command waits in the queue, ms. A command that waits longer is dropped, because the page may
 * have changed.
 */
export const WAIT_MAX_MS = 2000;

type Fetch = (input: string, init: RequestInit) => Promise<Response>;

/** Returns the path with its query. Undefined parameters of the query are omitted. */
export function address(path: string, query: Query = {}): string {
  const parts = Object.entries(query).filter((entry): entry is [string, string | number] => entry[1] !== undefined);
  if (parts.length === 0) return path;
  return `${path}?${parts.map(([key, value]) => `${encodeURIComponent(key)}=${encodeURIComponent(value)}`).join('&')}`;
}

/** Returns the refusal in an answer of any format. */
export function problemOf(status: number, text: string): Problem {
  try {
    const value: unknown = JSON.parse(text);
    if (typeof value === 'object' && value !== null && 'message' in value && 'code' in value) {
      return { ...(value as Problem), next: (value as Problem).next ?? '' };
    }
  } catch {
    // The answer is not JSON. A proxy sent it, or a router that does not know this path.
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
  /** True for a query, and for a command that moves nothing. */
  stays: boolean;
  go(): void;
  drop(why: string): void;
}

/** Returns the error for an answer that did not arrive, or that arrived only in part. */
function unreached(error: unknown): ApiError {
  const late = error instanceof DOMException && error.name === 'TimeoutError';
  return new ApiError(0, {
    code: late ? 'timeout' : 'no-connection',
    message: late ? 'The agent did not answer in time.' : 'The agent cannot be reached.',
    cause: 'The agent has ended, or the network to it is interrupted.',
    next: 'Check the network and that the agent runs. The emergency stop works without either.',
  });
}

async function textOf(response: Response): Promise<string> {
  try {
    return await response.text();
  } catch (error) {
    throw unreached(error);
  }
}

/** A client of an agent's API. */
export class Api {
  #open = 0;
  #waiting: Waiting[] = [];
  #yielding = new Set<AbortController>();
  readonly #token: () => string | undefined;
  readonly #key: () => string | undefined;
  readonly #fetch: Fetch;

  constructor(token: () => string | undefined, key: () => string | undefined, fetch?: Fetch) {
    this.#token = token;
    this.#key = key;
    this.#fetch = fetch ?? ((input, init) => globalThis.fetch(input, init));
  }

  /** Drops queued commands that may move the device, and cancels requests whose `yields` is true. */
  recall(why: string): void {
    const commands = this.#waiting.filter((each) => !each.stays);
    this.#waiting = this.#waiting.filter((each) => each.stays);
    for (const command of commands) command.drop(why);
    for (const request of this.#yielding) request.abort();
    this.#yielding.clear();
  }

  /** Sends a request, and returns the raw answer. Throws an ApiError if the request is refused, fails, or is not sent. */
  async send(method: string, path: string, ask: Ask = {}): Promise<Response> {
    if (ask.ahead || ask.keepalive) return this.#send(method, path, ask);
    if (this.#open >= OPEN_MAX) await this.#turn(method === 'GET' || ask.ends === true);
    else this.#open += 1;
    try {
      return await this.#send(method, path, ask);
    } finally {
      // The next request in the queue can be sent now.
      const next = this.#waiting.shift();
      if (next) next.go();
      else this.#open -= 1;
    }
  }

  #turn(stays: boolean): Promise<void> {
    return new Promise((go, fail) => {
      const own: Waiting = { stays, go, drop: (why) => fail(new ApiError(0, { code: 'not-sent', message: `${why}; nothing was sent.`, next: 'Ask for it again.' })) };
      this.#waiting.push(own);
      if (stays) return;
      setTimeout(() => {
        const at = this.#waiting.indexOf(own);
        if (at < 0) return;
        this.#waiting.splice(at, 1);
        own.drop('Other requests took too long');
      }, WAIT_MAX_MS);
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
    const late = AbortSignal.timeout(ask.within ?? 15_000);
    const own = ask.yields ? new AbortController() : undefined;
    if (own) this.#yielding.add(own);
    init.signal = own ? AbortSignal.any([late, own.signal]) : late;
    let response: Response;
    try {
      response = await this.#fetch(address(path, ask.query), init);
    } catch (error) {
      throw unreached(error);
    } finally {
      if (own) this.#yielding.delete(own);
    }
    if (!response.ok) throw new ApiError(response.status, problemOf(response.status, await textOf(response)));
    return response;
  }

  async json<T>(method: string, path: string, ask: Ask = {}): Promise<T> {
    const text = await textOf(await this.send(method, path, ask));
    return (text === '' ? undefined : JSON.parse(text)) as T;
  }

  get<T>(path: string, query?: Query): Promise<T> {
    return this.json<T>('GET', path, query ? { query } : {});
  }
}
