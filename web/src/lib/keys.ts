// Keys of the page. Everywhere except in text fields, the space bar sends a Stop.

/** The properties of an element that this module needs. */
export interface Focused {
  tagName: string;
  type?: string;
  isContentEditable?: boolean;
}

const TYPED = new Set(['text', 'search', 'url', 'tel', 'email', 'password', 'date', 'time', '']);

/**
 * Returns `true` if keys enter text in this element. Buttons, sliders and switches do not take text. On such
 * elements the space bar sends a Stop, and Enter presses the button.
 */
export function takesText(element: Focused | null | undefined): boolean {
  if (!element) return false;
  if (element.isContentEditable) return true;
  const tag = element.tagName.toUpperCase();
  if (tag === 'TEXTAREA') return true;
  return tag === 'INPUT' && TYPED.has((element.type ?? '').toLowerCase());
}

/** Returns "Tablet", "Phone" or "Computer", which other clients see as the name of the lease holder. */
export function deviceKind(agent: string, touchPoints: number, width: number): string {
  if (/iPhone|Android.*Mobile/i.test(agent)) return 'Phone';
  if (/iPad|Android|Tablet/i.test(agent) || (/Macintosh/.test(agent) && touchPoints > 1)) return 'Tablet';
  return touchPoints > 0 && width < 700 ? 'Phone' : 'Computer';
}
