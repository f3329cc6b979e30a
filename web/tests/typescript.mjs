// Lets Node run TypeScript. Each file is transpiled separately when it is loaded. Types are checked by `npm run check`.
import { register } from 'node:module';

register('./typescript-hooks.mjs', import.meta.url);
