import { svelte } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vite';

// The agent serves the built files from its own program, so they are the same bytes wherever they are built: no source maps (they hold
// paths), and names that depend on contents alone.
export default defineConfig({
  plugins: [svelte()],
  build: {
    target: 'es2022',
    sourcemap: false,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
    rollupOptions: { input: { index: 'index.html', chain: 'chain.html' } },
  },
  server: { proxy: { '/api': { target: process.env.AGENT ?? 'http://127.0.0.1:8780', ws: true, changeOrigin: true } } },
});
