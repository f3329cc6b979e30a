// Measured values of the last minutes, for plots and figures. The values are in a ring buffer of rows, which is read
// from the oldest row on.

export class History {
  readonly channels: number;
  readonly #room: number;
  readonly #data: Float64Array;
  #next = 0;
  #count = 0;

  constructor(channels: number, room: number) {
    this.channels = channels;
    this.#room = room;
    this.#data = new Float64Array(channels * room);
  }

  get length(): number {
    return this.#count;
  }

  /** Adds a row. The first value of the row is the time. Unknown values are NaN. */
  push(row: ArrayLike<number>): void {
    this.#data.set(row, this.#next * this.channels);
    this.#next = (this.#next + 1) % this.#room;
    this.#count = Math.min(this.#count + 1, this.#room);
  }

  clear(): void {
    this.#next = this.#count = 0;
  }

  /** Returns columns of the rows from a time on. NaN becomes null, which the plot shows as a gap. */
  since(time: number, columns: readonly number[]): (number | null)[][] {
    const out: (number | null)[][] = columns.map(() => []);
    for (let i = 0; i < this.#count; i += 1) {
      const row = ((this.#next - this.#count + i + this.#room) % this.#room) * this.channels;
      if ((this.#data[row] ?? 0) < time) continue;
      columns.forEach((column, k) => {
        const value = this.#data[row + column] ?? NaN;
        out[k]?.push(Number.isNaN(value) ? null : value);
      });
    }
    return out;
  }
}
