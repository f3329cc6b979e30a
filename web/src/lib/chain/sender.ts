// Sends an input while somebody moves a slider: the newest value, so often at most, one request at a time.

export interface Wires<T> {
  send(value: T): Promise<void>;
  refused(error: unknown): void;
  /** It waits, sends, or rests. */
  changed(busy: boolean): void;
  now(): number;
  later(act: () => void, ms: number): unknown;
  never(handle: unknown): void;
}

/** Time between the answer to one value and the next, ms. */
export const EVERY_MS = 100;

export class Sender<T> {
  #next: { value: T } | undefined;
  #timer: unknown;
  #sending = false;
  #sent = -Infinity;
  readonly #wires: Wires<T>;

  constructor(wires: Wires<T>) {
    this.#wires = wires;
  }

  put(value: T): void {
    this.#next = { value };
    this.#wires.changed(true);
    this.#go();
  }

  /** What waits is not sent any more: after a Stop, and where nothing is known. */
  drop(): void {
    this.#next = undefined;
    this.#wires.never(this.#timer);
    this.#timer = undefined;
    if (!this.#sending) this.#wires.changed(false);
  }

  #go(): void {
    if (this.#sending || this.#timer !== undefined || !this.#next) return;
    const wait = this.#sent + EVERY_MS - this.#wires.now();
    if (wait > 0) {
      this.#timer = this.#wires.later(() => {
        this.#timer = undefined;
        this.#go();
      }, wait);
      return;
    }
    const { value } = this.#next;
    this.#next = undefined;
    this.#sending = true;
    void this.#wires
      .send(value)
      .catch((error: unknown) => {
        // The rest of the same movement would be refused as well.
        this.#next = undefined;
        this.#wires.refused(error);
      })
      .finally(() => {
        this.#sending = false;
        // From its end: the first one may have taken the lease before it went.
        this.#sent = this.#wires.now();
        if (!this.#next) this.#wires.changed(false);
        this.#go();
      });
  }
}
