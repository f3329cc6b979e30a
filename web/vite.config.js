import { svelte } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vite';

// The agent's program contains the built files, so a build on any computer must give the same bytes. The build
// therefore makes no source maps, which contain paths, and the names of files depend only on the contents of the files.
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
