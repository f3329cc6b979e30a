// Jogging with a dead man's switch: rates go out as long as a key is held, zeros when it is let go, by whatever.

/** So often rates are sent, ms: they hold for 200 ms. */
export const PERIOD_MS = 90;
/** A request without an answer for so long is not waited for, ms. */
const LATE_MS = 1000;
/** A page that was suspended for so long does not know whether the key is still held, ms. */
const ASLEEP_MS = 450;

export interface JogLine {
  /** Sends rates; resolves when they were taken. Zeros end a jog, and are for whoever it is. */
  send(rates: number[]): Promise<unknown>;
  /** It was refused, and is not asked for on; `after`: the key had been let go by then. */
  refused(error: unknown, after: boolean): void;
  /** The page was suspended while a key was held, and it counts as let go. */
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

  /** A key is pressed: one joint, rad/s. */
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

  /** The key is let go, the pointer lost, the window left, the connection gone. Without a pressed key nothing is sent. */
  release(): void {
    if (!this.#rates) return;
    this.#end();
    this.#zeros();
  }

  #zeros(): void {
    // One at a time, and one more behind what may have overtaken it.
    if (this.#ending) {
      this.#again = true;
      return;
    }
    this.#ending = true;
    this.#again = false;
    this.#line
      .send(new Array<number>(6).fill(0))
      .catch(() => {
        // Rates hold for 200 ms only: without an answer the arm stops by itself.
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
    // One request at a time: the agent refuses a second one, and a slow line does not fill with old ones.
    if (this.#open > 0 && this.#line.now() - this.#sentAt < LATE_MS) return;
    const turn = this.#turn;
    this.#open += 1;
    this.#sentAt = this.#line.now();
    this.#line.send(rates).then(
      () => {
        this.#open -= 1;
        // Let go while these rates were on their way: zeros may have overtaken them, or were refused because of them.
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
