// Preview of a trajectory: pose of the arm at a time, path of the flange, and positions of
// problems.
import { type ArmModel, flange, place, type Vector } from './kinematics.ts';
import type { Points, ProblemObject } from './types.ts';

/** Returns the joint positions at a time, interpolated linearly between the points of the trajectory. */
export function previewAt(points: Points, time: number): number[] {
  const times = points.times_s;
  const last = times.length - 1;
  if (last < 0) return [];
  if (time <= (times[0] ?? 0)) return [...(points.positions_rad[0] ?? [])];
  if (time >= (times[last] ?? 0)) return [...(points.positions_rad[last] ?? [])];
  let [low, high] = [0, last];
  while (high - low > 1) {
    const mid = (low + high) >> 1;
    if ((times[mid] ?? 0) <= time) low = mid;
    else high = mid;
  }
  const [t0, t1] = [times[low] ?? 0, times[high] ?? 1];
  const share = t1 > t0 ? (time - t0) / (t1 - t0) : 0;
  const [from, to] = [points.positions_rad[low] ?? [], points.positions_rad[high] ?? []];
  return from.map((q, i) => q + share * ((to[i] ?? q) - q));
}

/** Returns the path of the flange, and the position of the worst point of each problem. */
export function wayOf(model: ArmModel, points: Points, problems: readonly ProblemObject[]): { line: Vector[]; places: { at: Vector; warning: boolean }[] } {
  const at = (q: readonly number[]) => place(flange(model, q));
  return {
    line: points.positions_rad.map(at),
    places: problems
      .filter((problem) => Number.isFinite(problem.time_s))
      .map((problem) => ({ at: at(previewAt(points, problem.time_s)), warning: problem.warning })),
  };
}
