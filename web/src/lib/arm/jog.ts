// Jogging with a dead man's switch. The page sends rates while a key is held. When the key is released for any reason,
// it sends zeros.

/** Interval at which the page sends rates, ms. A rate acts for 200 ms. */
export const PERIOD_MS = 90;
/** Longest wait for the answer to a request, ms. */
const LATE_MS = 1000;
/** Duration of a suspension of the page above which the state of the key counts as unknown, ms. */
const ASLEEP_MS = 450;

export interface JogLine {
  /**
   * Sends rates. Resolves when the agent has accepted the rates. Zeros end a jog, and the agent accepts them from every
   * client.
   */
  send(rates: number[]): Promise<unknown>;
  /**
   * Called if the agent refused the request and the page does not repeat it. `after`: the user had released the key by
   * then.
   */
  refused(error: unknown, after: boolean): void;
  /** Called if the page was suspended while a key was held. The key then counts as released. */
  slept(): void;
  every(act: () => void, ms: number): unknown;
  never(handle: unknown): void;
  now(): number;
}

export class Jogger {
  #rates: number[] | undefined;
  #timer: unknown;
  #open = 0;
  #sentAt = 0;
  #ticked = 0;
  #ending = false;
  #again = false;
  #turn = 0;
  readonly #line: JogLine;

  constructor(line: JogLine) {
    this.#line = line;
  }

  get isHeld(): boolean {
    return this.#rates !== undefined;
  }

  /** Presses a key, which moves one joint at `rate` (rad/s). */
  press(joint: number, rate: number): void {
    this.release();
    const rates = new Array<number>(6).fill(0);
    rates[joint - 1] = rate;
    this.#rates = rates;
    this.#turn += 1;
    this.#ticked = this.#line.now();
    this.#send();
    this.#timer = this.#line.every(() => this.#tick(), PERIOD_MS);
  }

  /**
   * Releases the key. Also called if the pointer, the window or the connection is lost. Without a pressed key no
   * request is sent.
   */
  release(): void {
    if (!this.#rates) return;
    this.#end();
    this.#zeros();
  }

  #zeros(): void {
    // At most one request with zeros is open. Another request follows, because rates may have overtaken the first
    // request.
    if (this.#ending) {
      this.#again = true;
      return;
    }
    this.#ending = true;
    this.#again = false;
    this.#line
      .send(new Array<number>(6).fill(0))
      .catch(() => {
        // The page ignores an error: rates act only for 200 ms, so the arm stops by itself without further requests.
      })
      .finally(() => {
        this.#ending = false;
        if (this.#again && !this.#rates) this.#zeros();
      });
  }

  #end(): void {
    this.#rates = undefined;
    this.#turn += 1;
    this.#line.never(this.#timer);
    this.#timer = undefined;
  }

  #tick(): void {
    const now = this.#line.now();
    const asleep = now - this.#ticked > ASLEEP_MS;
    this.#ticked = now;
    if (asleep) {
      this.release();
      this.#line.slept();
    } else this.#send();
  }

  #send(): void {
    const rates = this.#rates;
    if (!rates) return;
    // At most one request with rates is open. The agent refuses a second request, and old requests must not accumulate
    // on a slow line.
    if (this.#open > 0 && this.#line.now() - this.#sentAt < LATE_MS) return;
    const turn = this.#turn;
    this.#open += 1;
    this.#sentAt = this.#line.now();
    this.#line.send(rates).then(
      () => {
        this.#open -= 1;
        // The user released the key while these rates were being sent. The zeros may have overtaken the rates, or the
        // agent refused the zeros because of the rates. The page therefore sends zeros again.
        if (turn !== this.#turn && !this.#rates) this.#zeros();
      },
      (error: unknown) => {
        this.#open -= 1;
        if (turn === this.#turn) {
          this.#end();
          this.#line.refused(error, false);
        } else if (!this.#rates) this.#line.refused(error, true);
      },
    );
  }
}
