// Sender for an input while the user moves a slider. The sender sends the newest value at a limited rate, one
// request at a time.

export interface Wires<T> {
  send(value: T): Promise<void>;
  refused(error: unknown): void;
  /** Called when the sender becomes busy or idle. */
  changed(busy: boolean): void;
  now(): number;
  later(act: () => void, ms: number): unknown;
  never(handle: unknown): void;
}

/** Time between the answer to one value and the sending of the next value, ms. */
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

  /** Drops the waiting value. Called after a Stop, and when the state becomes unknown. */
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
        // The agent would also refuse later values of this drag.
        this.#next = undefined;
        this.#wires.refused(error);
      })
      .finally(() => {
        this.#sending = false;
        // The interval begins at the end of the request, because the first request may have waited for the lease.
        this.#sent = this.#wires.now();
        if (!this.#next) this.#wires.changed(false);
        this.#go();
      });
  }
}
