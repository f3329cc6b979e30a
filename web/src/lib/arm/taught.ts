// Points that were recorded while the arm was guided by hand, and the reduction of these points to few waypoints.

export interface Sample {
  t: number;
  q: number[];
}

/**
 * Returns the largest distance of a joint, rad, between a sample and the nearest point on the line between two other
 * samples.
 */
function aside(sample: Sample, from: Sample, to: Sample): number {
  // The code uses the nearest point on the line in joint space, not the point at the same time, because the speed of
  // the hand is irrelevant for the path.
  const way = to.q.map((value, i) => value - (from.q[i] ?? 0));
  const length = way.reduce((sum, value) => sum + value * value, 0);
  const along = sample.q.reduce((sum, value, i) => sum + (value - (from.q[i] ?? 0)) * (way[i] ?? 0), 0);
  const share = length > 0 ? Math.min(1, Math.max(0, along / length)) : 0;
  return Math.max(...sample.q.map((value, i) => Math.abs(value - ((from.q[i] ?? 0) + share * (way[i] ?? 0)))));
}

/**
 * Returns the fewest samples that keep every joint within `tolerance` of the path between the samples (Ramer 1972;
 * Douglas & Peucker 1973).
 */
export function thin(samples: readonly Sample[], tolerance: number): Sample[] {
  if (samples.length <= 2) return [...samples];
  const keep = new Array<boolean>(samples.length).fill(false);
  keep[0] = keep[samples.length - 1] = true;
  const open: [number, number][] = [[0, samples.length - 1]];
  for (let part = open.pop(); part; part = open.pop()) {
    const [low, high] = part;
    const [from, to] = [samples[low], samples[high]];
    if (!from || !to) continue;
    let [worst, at] = [tolerance, -1];
    for (let i = low + 1; i < high; i += 1) {
      const sample = samples[i];
      const distance = sample ? aside(sample, from, to) : 0;
      if (distance > worst) [worst, at] = [distance, i];
    }
    if (at < 0) continue;
    keep[at] = true;
    open.push([low, at], [at, high]);
  }
  return samples.filter((_, i) => keep[i]);
}

/** Removes the repeated samples that an arm at rest produces. */
export function moved(samples: readonly Sample[], least = 0.002): Sample[] {
  const out: Sample[] = [];
  for (const sample of samples) {
    const last = out.at(-1);
    if (!last || sample.q.some((value, i) => Math.abs(value - (last.q[i] ?? 0)) > least)) out.push(sample);
  }
  return out;
}

/** Returns waypoints as a file for the planner of the agent. */
export function waypoints(positions: readonly (readonly number[])[]): string {
  const rows = positions.map((q) => q.map((value) => value.toFixed(6)).join(','));
  return ['q1,q2,q3,q4,q5,q6', ...rows, ''].join('\n');
}
