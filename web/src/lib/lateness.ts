// How late messages are: a network that delays everything by the same time loses nothing, and what is shown is old all the same.

/** Times of so many spans are kept; after that two clocks may have drifted apart, ms. */
const SPAN_MS = 60_000;
const SPANS = 10;

/**
 * Compares the clock of an agent, as its messages have it, with this browser's: the message that came soonest tells the difference, and every other one how much
 * later it came. Both clocks count ms from whenever.
 */
export class Lateness {
  /** Least difference in each span, the newest last. */
  #least: number[] = [];
  #span = -1;

  /** A message that was made at `made` by the agent's clock came at `now`; how late, ms, beside the soonest. */
  take(made: number, now: number): number {
    const span = Math.floor(now / SPAN_MS);
    const difference = now - made;
    if (span !== this.#span) {
      this.#span = span;
      this.#least = [...this.#least.slice(1 - SPANS), difference];
    } else {
      this.#least[this.#least.length - 1] = Math.min(this.#least.at(-1) ?? difference, difference);
    }
    return difference - Math.min(...this.#least);
  }

  /** What the agent's clock shows at `now`, or a little less: as long as the soonest message was on its way. */
  agentTime(now: number): number | undefined {
    return this.#least.length === 0 ? undefined : Math.floor(now - Math.min(...this.#least));
  }

  forget(): void {
    this.#least = [];
    this.#span = -1;
  }
}
