// Lets Node run TypeScript: each file is transpiled by itself as it is loaded. Types are checked by `npm run check`.
import { register } from 'node:module';

register('./typescript-hooks.mjs', import.meta.url);
