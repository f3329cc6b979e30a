// Delay of messages. If a network delays all messages by the same time, no message is lost, but the displayed state
// is old.

/** Length of a span, ms. Times are kept for `SPANS` spans. Over a longer time, two clocks may drift apart. */
const SPAN_MS = 60_000;
const SPANS = 10;
/**
 * Smallest number of probes that give a lower bound of the clock difference, because a single probe may have been
 * delayed.
 */
const PROBES = 3;
/** Time for which a probe is used, ms. */
const PROBED_MS = 120_000;

/**
 * Compares the clock of an agent, from the times in the agent's messages, with this browser's clock. Both clocks count
 * ms from any start. The fastest message gives an upper bound of the clock difference. The agent creates an answer after
 * the request was sent. The times of request and answer therefore give a lower bound, and show a delay of all messages.
 * If the two bounds contradict each other, one of the clocks was suspended, and all earlier bounds are dropped.
 */
export class Lateness {
  /** Smallest clock difference in each span that had messages. The newest span is the last one. */
  #spans: { span: number; least: number }[] = [];
  /** Lower bounds of the clock difference, and the time of each bound. */
  #floors: { at: number; floor: number }[] = [];

  /** Stores the answer to a request that was sent at `sent`. `made` is the time of the answer by the agent's clock. */
  probe(sent: number, made: number): void {
    const floor = sent - made;
    if (this.#spans.length > 0 && floor > this.#least() + 1) this.#spans = [];
    this.#floors = [...this.#floors.filter(({ at }) => at > sent - PROBED_MS), { at: sent, floor }];
  }

  /**
   * Returns the largest possible delay, ms, of a message that was created at `made` and received at `now`. Without
   * probes the delay is relative to the fastest message.
   */
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

  /** Returns the agent's clock at `now`. The returned time may be too low by the delay of the fastest message. */
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
