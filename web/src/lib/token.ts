// Token of this browser. The page reads the token from the address (#token=…), from this session, or from
// the storage of this device.

import type { Store } from './storage.ts';

const NAME = 'openjtc-token';

/** Returns the token in the fragment of an address, and the fragment without it. */
export function tokenIn(hash: string): { token: string | undefined; rest: string } {
  const parts = hash.replace(/^#/, '').split('&').filter(Boolean);
  const own = parts.find((part) => part.startsWith('token='));
  const rest = parts.filter((part) => part !== own).join('&');
  const token = own ? decoded(own.slice('token='.length)).trim() : undefined;
  return { token: token || undefined, rest: rest ? `#${rest}` : '' };
}

/** Decodes a token. A text that is not a valid encoding is returned unchanged. No agent accepts it as a token. */
function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

/** Storage of the token. */
export class TokenStore {
  readonly #session: Store;
  readonly #device: Store;

  constructor(session: Store, device: Store) {
    this.#session = session;
    this.#device = device;
  }

  get(): string | undefined {
    return this.#session.getItem(NAME) ?? this.#device.getItem(NAME) ?? undefined;
  }

  isRemembered(): boolean {
    return this.#device.getItem(NAME) !== null;
  }

  /** Sets the token for this tab only. The stored token of the device stays unchanged. */
  use(token: string): void {
    this.#session.setItem(NAME, token);
  }

  set(token: string, remember: boolean): void {
    this.#session.setItem(NAME, token);
    if (remember) this.#device.setItem(NAME, token);
    else this.#device.removeItem(NAME);
  }

  forget(): void {
    this.#session.removeItem(NAME);
    this.#device.removeItem(NAME);
  }
}
