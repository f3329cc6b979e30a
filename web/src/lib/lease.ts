// The lease: only one client at a time can command. The first command of a client takes the lease. The page renews
// the lease while the page is in use, and releases it when the user requests this or closes the page.
import { type Api, ApiError } from './api.ts';

export type Policy = 'continue' | 'pause' | 'stop';

interface Grant {
  key: string;
  held: boolean;
  lasts_s: number;
}

export type LeasePhase = 'none' | 'held' | 'waiting';

export const LASTS_S = 10;
export const RENEW_MS = 3000;

export interface LeaseWishes {
  name(): string;
  policy(): Policy;
  /** Called when `phase` or `wantedBy` has changed. */
  changed(): void;
}

export class Lease {
  key: string | undefined;
  phase: LeasePhase = 'none';
  wantedBy: string | undefined;
  #taking: Promise<void> | undefined;
  readonly #api: Api;
  readonly #wishes: LeaseWishes;

  constructor(api: Api, wishes: LeaseWishes) {
    this.#api = api;
    this.#wishes = wishes;
  }

  /** Takes the lease if this client does not hold it. Two commands at the same time send only one request. */
  take(): Promise<void> {
    if (this.phase === 'held') return Promise.resolve();
    this.#taking ??= this.#post(false).finally(() => (this.#taking = undefined));
    return this.#taking;
  }

  /** Asks the lease holder for the lease. Renewing the request keeps the position in the queue. */
  ask(): Promise<void> {
    return this.#post(true);
  }

  async #post(ask: boolean): Promise<void> {
    const body = { name: this.#wishes.name(), policy: this.#wishes.policy(), lasts_s: LASTS_S, ask };
    const grant = await this.#api.json<Grant>('POST', '/api/lease', { body });
    this.#enter(grant.held ? 'held' : 'waiting', grant.key);
  }

  /** Renews the lease, or the position in the queue for the lease. Returns `true` if this client holds the lease. */
  async renew(): Promise<boolean> {
    if (!this.key) return false;
    const key = this.key;
    try {
      const state = await this.#api.json<{ held: boolean; wanted_by?: string | null }>('PUT', '/api/lease', { within: 5000 });
      if (this.key !== key) return this.phase === 'held';
      const lost = this.phase === 'held' && !state.held;
      this.wantedBy = state.wanted_by ?? undefined;
      if (lost) this.#enter('none', undefined);
      else this.#enter(state.held ? 'held' : 'waiting', key);
    } catch (error) {
      // If no answer arrived, this client may still hold the lease. After a refusal it does not hold the lease.
      if (!(error instanceof ApiError) || error.isNoConnection) return this.phase === 'held';
      if (this.key === key) this.#enter('none', undefined);
    }
    return this.phase === 'held';
  }

  /** Records that the agent refused a command, because another client holds the lease or the agent no longer knows this key. */
  lost(): void {
    this.#enter('none', undefined);
  }

  async release(keepalive = false): Promise<void> {
    if (!this.key) return;
    try {
      await this.#api.send('DELETE', '/api/lease', { keepalive, within: 5000 });
      this.#enter('none', undefined);
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 409) this.#enter('none', undefined);
      throw error;
    }
  }

  #enter(phase: LeasePhase, key: string | undefined): void {
    this.phase = phase;
    this.key = key;
    if (phase !== 'held') this.wantedBy = undefined;
    this.#wishes.changed();
  }
}
