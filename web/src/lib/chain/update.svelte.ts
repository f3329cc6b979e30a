// Contents of the update form. The contents stay while another tab is shown.
import type { UpdateRequest } from './types.ts';

export interface Picked {
  name: string;
  size: number;
  base64: string;
}

/** Largest image that the agent accepts, bytes. The base64 text is a third larger. */
export const SIZE_MOST = 1 << 20;

export async function pick(file: File): Promise<Picked> {
  const bytes = new Uint8Array(await file.arrayBuffer());
  let text = '';
  for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return { name: file.name, size: bytes.length, base64: btoa(text) };
}

/**
 * Returns the format of an image file. The page accepts raw bytes only in `.bin` files, so that a text is never flashed
 * as raw bytes by mistake.
 */
export function formatOf(name: string): UpdateRequest['format'] {
  return /\.bin$/i.test(name) ? 'bin' : undefined;
}

/** Parses a number such as 0x4B3F or 19263. Undefined: the text is not a valid number. */
export function word(text: string): number | undefined {
  const trimmed = text.trim();
  if (!/^(0x[0-9a-f]{1,4}|\d{1,5})$/i.test(trimmed)) return undefined;
  const value = Number(trimmed);
  return value <= 0xffff ? value : undefined;
}

class UpdateForm {
  boards = $state<number[]>([]);
  /** Flash numbers of the boards when the user chose the boards. The boards must still have the same flash numbers when the update is sent. */
  #flash = new Map<number, number>();
  image = $state.raw<Picked | undefined>(undefined);
  second = $state.raw<Picked | undefined>(undefined);
  format = $state<'' | 'bin' | 'hex' | 'srec'>('');
  addresses = $state<'' | 'byte' | 'word'>('');
  date = $state('');
  programId = $state('');
  checkFlash = $state(true);
  group = $state(false);
  start = $state(false);
  force = $state(false);
  unverified = $state(false);

  choose(boards: readonly number[], flashOf: (board: number) => number | null | undefined): void {
    for (const board of boards) {
      const flash = flashOf(board);
      if (!this.boards.includes(board) && flash != null) this.#flash.set(board, flash);
    }
    this.boards = [...boards].sort((a, b) => a - b);
    for (const board of this.#flash.keys()) if (!boards.includes(board)) this.#flash.delete(board);
  }

  request(dryRun: boolean): UpdateRequest | undefined {
    if (!this.image || this.boards.length === 0) return undefined;
    const expected = word(this.programId);
    const format = this.format || formatOf(this.image.name);
    return {
      boards: this.boards.map((board) => {
        const flash_number = this.#flash.get(board);
        return { board, ...(this.checkFlash && flash_number !== undefined ? { flash_number } : {}) };
      }),
      image: this.image.base64,
      ...(this.second ? { second: this.second.base64 } : {}),
      ...(format ? { format } : {}),
      ...(this.addresses ? { addresses: this.addresses } : {}),
      ...(this.date ? { date: this.date } : {}),
      ...(expected === undefined ? {} : { expect_program_id: expected }),
      group: this.group,
      start: this.start,
      dry_run: dryRun,
      force: this.force,
      accept_unverified: this.unverified,
    };
  }
}

export const form = new UpdateForm();
