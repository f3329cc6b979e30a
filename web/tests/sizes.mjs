// Checks the compressed sizes of the built pages: the scripts that a browser loads first, and all files.
import { readdirSync, readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const DIST = process.env.DIST ?? fileURLToPath(new URL('../dist/', import.meta.url));
const FIRST_MOST = { 'index.html': 44_000, 'chain.html': 44_000 };
const ALL_MOST = 400_000;
const gzipped = (path) => gzipSync(readFileSync(path), { level: 9 }).length;

const follow = (path, first) => {
  if (first.has(path)) return;
  first.add(path);
  const text = readFileSync(path, 'utf8');
  // Follows only static imports, because dynamic imports are loaded later.
  for (const [, next] of text.matchAll(/(?:from|import)\s*["'](\.\/[^"']+\.js)["']/g)) follow(join(dirname(path), next), first);
};
let large = false;
for (const [page, most] of Object.entries(FIRST_MOST)) {
  const first = new Set();
  for (const [, path] of readFileSync(join(DIST, page), 'utf8').matchAll(/(?:src|href)="(\/[^"]+\.js)"/g)) follow(join(DIST, path), first);
  const bytes = [...first].reduce((sum, path) => sum + gzipped(path), 0);
  console.log(`${page}: first JS ${(bytes / 1000).toFixed(1)} kB of ${most / 1000} kB gzip`);
  large ||= bytes > most;
}
const files = readdirSync(DIST, { recursive: true, withFileTypes: true }).filter((entry) => entry.isFile());
const all = files.reduce((sum, entry) => sum + gzipped(join(entry.parentPath, entry.name)), 0);
console.log(`all ${(all / 1000).toFixed(1)} kB of ${ALL_MOST / 1000} kB gzip`);
if (large || all > ALL_MOST) {
  console.error('a page is larger than it may be');
  process.exit(1);
}
