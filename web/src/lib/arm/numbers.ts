// Numbers of stored trajectories on the agent: 1 to 99.

export const NUMBER_MAX = 99;

/**
 * Returns the lowest free trajectory number. If all numbers are used, returns the highest number, which the agent
 * refuses.
 */
export function freeNumber(kept: readonly { number: number }[]): number {
  const taken = new Set(kept.map((each) => each.number));
  for (let number = 1; number <= NUMBER_MAX; number += 1) if (!taken.has(number)) return number;
  return NUMBER_MAX;
}
