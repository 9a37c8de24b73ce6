// Bundles the viewer into dist/viewer.js, the one file that 'lamina view' puts into its pages. Usage: node build.js
import { readFileSync, writeFileSync } from 'node:fs';
import { build } from 'esbuild';

const out = new URL('dist/viewer.js', import.meta.url).pathname;
await build({
  entryPoints: [new URL('src/main.js', import.meta.url).pathname],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  charset: 'utf8',
  legalComments: 'none',
  loader: { '.css': 'text' },
  outfile: out,
  logLevel: 'warning',
  banner: {
    js: '/* three.js, MIT License, (c) three.js authors; 3d-tiles-renderer, Apache License 2.0, (c) California Institute of\n' +
      'Technology; meshoptimizer, MIT License, (c) Arseny Kapoulkine; Lamina, Apache License 2.0 */',
  },
});
// It stands inside a script element, which these would end or turn into something else.
const text = readFileSync(out, 'utf8');
if (/<\/script|<!--/i.test(text)) {
  writeFileSync(out, text.replace(/<\/(script)/gi, '<\\/$1').replace(/<!--/g, '<\\!--'));
}
console.log(`viewer: ${out}, ${Math.round(text.length / 1024)} KB`);
