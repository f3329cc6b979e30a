// Delay of messages: a network that delays all messages by the same time loses none, but the displayed state is old.

/** Length of a span, ms; times are kept for `SPANS` spans, after which two clocks may have drifted apart. */
const SPAN_MS = 60_000;
const SPANS = 10;
/** Least number of probes for a lower bound of the difference: a single probe may have been delayed. */
const PROBES = 3;
/** Time for which a probe counts, ms. */
const PROBED_MS = 120_000;

/**
 * Compares the clock of an agent, from the times in its messages, with this browser's; both count ms from any start.
 * The fastest message bounds the difference from above. An answer was created after its request: that bounds the
 * difference from below, and shows a delay of all messages. If the two bounds contradict each other, a clock has stood
 * still, and all earlier bounds are dropped.
 */
export class Lateness {
  /** Least difference in each span that had messages, the newest last. */
  #spans: { span: number; least: number }[] = [];
  /** Lower bounds of the difference, and the time of each. */
  #floors: { at: number; floor: number }[] = [];

  /** A request sent at `sent` was answered, at `made` by the agent's clock. */
  probe(sent: number, made: number): void {
    const floor = sent - made;
    if (this.#spans.length > 0 && floor > this.#least() + 1) this.#spans = [];
    this.#floors = [...this.#floors.filter(({ at }) => at > sent - PROBED_MS), { at: sent, floor }];
  }

  /** Returns the largest delay, ms, of a message created at `made` and received at `now`; without probes, relative to the fastest. */
  take(made: number, now: number): number {
    const span = Math.floor(now / SPAN_MS);
    const difference = now - made;
    const last = this.#spans.at(-1);
    if (last?.span === span) last.least = Math.min(last.least, difference);
    else this.#spans = [...this.#spans.filter((each) => each.span > span - SPANS), { span, least: difference }];
    if (this.#floors.some(({ floor }) => floor > difference + 1)) this.#floors = [];
    const floor = this.#floors.length < PROBES ? this.#least() : Math.max(...this.#floors.map((each) => each.floor));
    return difference - floor;
  }

  /** Returns the agent's clock at `now`, or slightly less: by the delay of the fastest message. */
  agentTime(now: number): number | undefined {
    return this.#spans.length === 0 ? undefined : Math.floor(now - this.#least());
  }

  forget(): void {
    this.#spans = [];
    this.#floors = [];
  }

  #least(): number {
    return Math.min(...this.#spans.map((each) => each.least));
  }
}
