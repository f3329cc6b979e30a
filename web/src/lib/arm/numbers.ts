// Numbers under which the agent keeps trajectories: 1 to 99.

export const NUMBER_MAX = 99;

/** The lowest that nothing has; the highest where all are taken, and the agent refuses it. */
export function freeNumber(kept: readonly { number: number }[]): number {
  const taken = new Set(kept.map((each) => each.number));
  for (let number = 1; number <= NUMBER_MAX; number += 1) if (!taken.has(number)) return number;
  return NUMBER_MAX;
}
