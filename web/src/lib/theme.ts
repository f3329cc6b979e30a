// Theme of the page: light, dark, or the setting of the system.

import { device } from './storage.ts';

export type Theme = 'auto' | 'light' | 'dark';

const NAME = 'openjtc-theme';
const system = matchMedia('(prefers-color-scheme: dark)');
let chosen = savedTheme();

export function savedTheme(): Theme {
  const saved = device.getItem(NAME);
  return saved === 'light' || saved === 'dark' ? saved : 'auto';
}

/** Applies the theme now, and again when the setting of the system changes. */
export function applyTheme(theme: Theme): void {
  chosen = theme;
  if (theme === 'auto') device.removeItem(NAME);
  else device.setItem(NAME, theme);
  show();
}

/** Returns `true` if the page is dark at present. */
export function isDark(theme: Theme): boolean {
  return theme === 'dark' || (theme === 'auto' && system.matches);
}

function show(): void {
  document.documentElement.dataset.theme = isDark(chosen) ? 'dark' : 'light';
}

system.addEventListener('change', show);
show();
