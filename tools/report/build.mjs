// SPDX-License-Identifier: BSD-3-Clause
//
// Bundles the page of reports: node build.mjs MODULES OUT, where MODULES is the folder that `npm ci` filled and OUT
// the HTML file to write. Scripts and styles stand in it; it asks for nothing at run time.
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const [modules, out] = process.argv.slice(2).map((name) => path.resolve(name));
const here = path.dirname(fileURLToPath(import.meta.url));
const require = createRequire(path.join(modules, 'package.json'));
const esbuild = require('esbuild');

async function bundle(entry) {
  const result = await esbuild.build({
    entryPoints: [path.join(here, entry)],
    nodePaths: [path.join(modules, 'node_modules')],
    bundle: true,
    minify: true,
    write: false,
    format: 'iife',
    target: ['es2020', 'chrome90', 'firefox90', 'safari15'],
    charset: 'ascii',
    legalComments: 'none', // the whole licences stand in the page
    logLevel: 'warning',
  });
  return result.outputFiles[0].text;
}

function licence(name) {
  const folder = path.join(modules, 'node_modules', name);
  const { version } = JSON.parse(readFileSync(path.join(folder, 'package.json'), 'utf8'));
  const text = readFileSync(path.join(folder, 'LICENSE'), 'utf8').trim();
  return `${name} ${version}\n\n${text.replaceAll('--', '- -')}\n`;
}

const css = readFileSync(path.join(modules, 'node_modules/uplot/dist/uPlot.min.css'), 'utf8') +
  (await bundle('src/style.css'));
const parts = {
  LICENCES: ['three', 'uplot'].map(licence).join('\n'),
  STYLE: css,
  SCRIPT: await bundle('src/main.js'),
};
let page = readFileSync(path.join(here, 'src/template.html'), 'utf8');
for (const [name, text] of Object.entries(parts)) {
  if (page.split(`@${name}@`).length !== 2) throw new Error(`template.html has @${name}@ not once`);
  page = page.replace(`@${name}@`, () => text);
}
if (page.split('@DYNSLAM_REPORT@').length !== 2) throw new Error('@DYNSLAM_REPORT@ stands not once in the page');
writeFileSync(out, page);
