// `npm ci && npm run vendor`: bundles the parts of plotly.js that the plots use into ../vendor/plotly.min.js, with the
// licences of everything that is in it. The result is committed, so that nothing of this is needed to build the crate.
import { build } from 'esbuild';
import { existsSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';

const result = await build({
  entryPoints: ['entry.js'],
  bundle: true,
  minify: true,
  write: false,
  metafile: true,
  format: 'iife',
  globalName: 'Plotly',
  target: 'es2016',
  outdir: 'out',
  charset: 'ascii',
  legalComments: 'none',
  define: { global: 'window', 'define.amd': 'false' },
});
// styles belong to maps, which are not in the bundle
const script = result.outputFiles.find((f) => f.path.endsWith('.js'));
const packages = new Map();
for (const input of Object.keys(result.metafile.inputs)) {
  const at = input.lastIndexOf('node_modules/');
  if (at < 0) continue;
  let folder = dirname(input);
  while (!existsSync(join(folder, 'package.json')) || !JSON.parse(readFileSync(join(folder, 'package.json'))).version) {
    folder = dirname(folder);
  }
  packages.set(folder, JSON.parse(readFileSync(join(folder, 'package.json'))));
}
let licences = 'Licences of what is bundled into plotly.min.js\n';
for (const [folder, p] of [...packages].sort((a, b) => a[1].name.localeCompare(b[1].name))) {
  const file = readdirSync(folder).find((f) => /^licen[cs]e/i.test(f));
  const said = typeof p.license === 'string' ? p.license : (p.license?.type ?? 'see its package');
  const text = file ? readFileSync(join(folder, file), 'utf8').trim() : '(no file of its own)';
  licences += `\n${'='.repeat(78)}\n${p.name} ${p.version}: ${said}\n\n${text}\n`;
}
const head = `/* plotly.js ${packages.get('node_modules/plotly.js').version}, MIT (LICENSES.txt): core, bar, cone, heatmap, mesh3d, scatter3d, scattergl */\n`;
writeFileSync('../vendor/plotly.min.js', head + script.text);
writeFileSync('../vendor/LICENSES.txt', licences);
console.log(`${script.text.length} bytes, ${packages.size} packages`);
