// Progress of an update. The agent transfers the image twice: first to check it, then to write it. The
// agent then reads the image's identity back.
import type { Course } from './chain.svelte.ts';

export interface Phase {
  /** Number of the current phase. 0: the image is checked, 1: it is written, 2: it is read back. */
  at: number;
  /** Share of the whole transfer to these boards that is complete, 0 to 1. */
  share: number;
  words: string;
}

export const PHASES = ['Transferred and checked', 'Written', 'Read back'] as const;

export function phaseOf(course: Pick<Course, 'progress'> | undefined): Phase | undefined {
  const progress = course?.progress;
  if (!progress) return undefined;
  const share = progress.total > 0 ? Math.min(1, progress.bytes / progress.total) : 0;
  const percent = `${Math.round(share * 100)} %`;
  const again = progress.attempt > 1 ? `, attempt ${progress.attempt}` : '';
  if (share >= 1) return { at: 2, share, words: `read back${again}` };
  if (progress.cycle >= 2) return { at: 1, share, words: `is written, ${percent}${again}` };
  return { at: 0, share, words: `checked, nothing erased yet, ${percent}${again}` };
}
