// SPDX-License-Identifier: BSD-3-Clause
//
// Opens WORK/report.html in a browser without a window and uses it as a reader would:
//   node browser.mjs MODULES CHROMIUM WORK
// Ends with 1 and a line for each thing that is wrong.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, executablePath, work] = process.argv.slice(2).map((name) => path.resolve(name));
const { chromium } = createRequire(path.join(modules, 'package.json'))('playwright-core');

const faults = [];
const check = (holds, what) => holds || faults.push(what);

const profile = mkdtempSync(path.join(work, 'profile-'));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath,
  viewport: { width: 1280, height: 900 },
  args: ['--no-sandbox', '--disable-gpu', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
    '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
});
const page = browser.pages()[0] ?? (await browser.newPage());
const asked = [];
page.on('console', (message) => message.type() === 'error' && faults.push(`the page's console: ${message.text()}`));
page.on('pageerror', (error) => faults.push(`the page: ${error.message}`));
page.on('request', (request) => /^(data|blob):/.test(request.url()) || asked.push(request.url()));

const shot = async (selector, name) => {
  const picture = await page.locator(selector).first().screenshot();
  if (name) writeFileSync(path.join(work, `${name}.png`), picture);
  return picture.toString('base64');
};
// Of two pictures: how many colours the first has, and the share of pixels that differ.
const compare = (a, b = a) => page.evaluate(async ([first, second]) => {
  const pixels = async (png) => {
    const image = new Image();
    image.src = `data:image/png;base64,${png}`;
    await image.decode();
    const canvas = Object.assign(document.createElement('canvas'), { width: image.width, height: image.height });
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    return new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
  };
  const [p, q] = [await pixels(first), await pixels(second)];
  let differ = 0;
  for (let i = 0; i < p.length; ++i) differ += p[i] !== q[i] ? 1 : 0;
  return { colours: new Set(p).size, differ: differ / p.length };
}, [a, b]);
const drawn = () => page.evaluate(() => new Promise((done) => {
  requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 100)));
}));
const frameShown = (index) => page.waitForFunction((i) => document.getElementById('frames').dataset.drawn === i,
  String(index), { timeout: 5000 });

await page.emulateMedia({ colorScheme: 'light' });
await page.goto(pathToFileURL(path.join(work, 'report.html')).href);
await frameShown(0);
await drawn();

// What evaluation says stands in the tables.
const { ate_m: ate } = JSON.parse(readFileSync(path.join(work, 'eval.json'), 'utf8'));
const errors = await page.locator('#errors').innerText();
check(errors.includes(ate.rmse.toFixed(4)), `the tables lack the ATE of eval, ${ate.rmse.toFixed(4)}`);
check(/none/.test(errors) && /both/.test(errors), 'the tables lack a run');
check(/IoU/.test(errors), 'the tables lack the masks');

// Both scenes and all plots show something.
for (const [selector, least] of [['#paths3d canvas', 20], ['#map canvas', 50], ['#graph-time', 8], ['#graph-plan', 8],
  ['#curves .uplot', 20], ['#times .uplot', 20]]) {
  const { colours } = await compare(await shot(selector));
  check(colours >= least, `${selector} shows ${colours} colours`);
}
check(await page.locator('#curves .uplot').count() === 8, 'there are not 8 curves');
check(await page.locator('#stages tbody tr').count() >= 8, 'the table of stages is short');

// A class of voxels goes and comes back.
const all = await shot('#map canvas', 'voxels');
const box = page.locator('#classes input[data-key="0"]');
check(await page.locator('#classes input').count() >= 3, 'there are fewer than two classes of voxels');
await box.uncheck();
await drawn();
const without = await compare(all, await shot('#map canvas'));
check(without.differ > 0.02, `without the background ${(100 * without.differ).toFixed(2)} % of the map's picture differ`);
await box.check();
await drawn();
check((await compare(all, await shot('#map canvas'))).differ < 0.001, 'the class does not come back');

// The scene turns.
const before = await shot('#paths3d canvas');
const place = await page.locator('#paths3d canvas').boundingBox();
await page.mouse.move(place.x + place.width / 2, place.y + place.height / 2);
await page.mouse.down();
await page.mouse.move(place.x + place.width / 2 + 120, place.y + place.height / 2 + 40, { steps: 4 });
await page.mouse.up();
await drawn();
check((await compare(before, await shot('#paths3d canvas'))).differ > 0.002, 'the trajectory does not turn');

// The scrubber shows another frame, with keypoints and masks.
const first = await shot('#view-colour');
await page.locator('#scrub').fill('30');
await frameShown(30);
check((await compare(first, await shot('#view-colour'))).differ > 0.2, 'the scrubber does not change the frame');
check(/^31\/45/.test(await page.locator('#frames output').innerText()), 'the readout does not count frames');
const caption = await page.locator('#frames figcaption').first().innerText();
check(Number(/(\d+) keypoints/.exec(caption)?.[1] ?? 0) > 50, `few keypoints: ${caption}`);
const withPoints = await shot('#view-colour');
await page.locator('#frames input[data-key="keypoints"]').uncheck();
await drawn();
check((await compare(withPoints, await shot('#view-colour'))).differ > 0.01, 'keypoints cannot be hidden');
await page.locator('#frames input[data-key="keypoints"]').check();
for (const mask of ['semantic', 'geometric', 'fused', 'true']) {
  const covered = await page.locator(`#view-${mask}`).evaluate((canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let strong = 0;  // pixels of the mask's colour: pictures below are pale
    for (let i = 0; i < data.length; i += 4) {
      strong += Math.max(data[i], data[i + 1], data[i + 2]) - Math.min(data[i], data[i + 1], data[i + 2]) > 90 ? 1 : 0;
    }
    return strong / (data.length / 4);
  });
  check(covered > 0.005 && covered < 0.7, `the mask ${mask} covers ${(100 * covered).toFixed(1)} %`);
}
await page.locator('body').click({ position: { x: 3, y: 300 } });
await page.keyboard.press('ArrowRight');
await frameShown(31);

// The other run.
await page.locator('.picker button[data-run="none"]').click();
await drawn();
check(/no static weights/.test(await page.locator('#frames figcaption').first().innerText()), 'the run cannot be chosen');
await page.locator('.picker button[data-run="both"]').click();

// Both schemes, and what a phone has room for.
for (const [scheme, dark] of [['light', false], ['dark', true]]) {
  await page.emulateMedia({ colorScheme: scheme });
  await drawn();
  const [r, g, b] = await page.evaluate(() => getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number));
  check((r + g + b < 200) === dark, `the page is not ${scheme}`);
  check((await compare(await shot('#map canvas'))).colours >= 50, `no voxels in the ${scheme} scheme`);
  for (const id of ['errors', 'trajectory', 'frames', 'times', 'graph', 'map', 'config']) await shot(`#${id}`, `${scheme}-${id}`);
}
await page.setViewportSize({ width: 390, height: 800 });
await drawn();
check(await page.evaluate(() => document.documentElement.scrollWidth <= 400), 'the page is wider than a phone');
check(asked.length === 1 && asked[0].startsWith('file:'), `the page asked for ${asked.slice(1).join(', ')}`);
await browser.close();
rmSync(profile, { recursive: true, force: true });

if (faults.length > 0) {
  console.error(faults.join('\n'));
  process.exit(1);
}
console.log(`the report was read in ${executablePath}: nothing is wrong`);
