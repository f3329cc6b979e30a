// How late messages are: a network that delays everything by the same time loses nothing, and what is shown is old all the same.

/** Times of so many spans are kept; after that two clocks may have drifted apart, ms. */
const SPAN_MS = 60_000;
const SPANS = 10;
/** So many questions bound the difference from below before that counts: one may have been long on its way. */
const PROBES = 3;
/** For so long, ms. */
const PROBED_MS = 120_000;

/**
 * Compares the clock of an agent, as its messages have it, with this browser's; both count ms from whenever. The message that came soonest bounds the difference
 * from above. An answer was made behind the question: that bounds it from below, and shows a delay that all messages have. Where the two contradict each other a
 * clock has stood still, and what was known of it is forgotten.
 */
export class Lateness {
  /** Least difference in each span that had messages, the newest last. */
  #spans: { span: number; least: number }[] = [];
  /** Differences that the true one is not below, and when that was seen. */
  #floors: { at: number; floor: number }[] = [];

  /** A question of `sent` was answered, at `made` by the agent's clock. */
  probe(sent: number, made: number): void {
    const floor = sent - made;
    if (this.#spans.length > 0 && floor > this.#least() + 1) this.#spans = [];
    this.#floors = [...this.#floors.filter(({ at }) => at > sent - PROBED_MS), { at: sent, floor }];
  }

  /** A message that was made at `made` by the agent's clock came at `now`; how late, ms, at the most, or beside the soonest as long as nothing was asked. */
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

  /** What the agent's clock shows at `now`, or a little less: as long as the soonest message was on its way. */
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
