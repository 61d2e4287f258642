// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads report pages as people do who use a keyboard, a screen reader or a phone: the rules of axe-core, the order of
// focus, sorting, and contents.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import {FIGURES, PHONE, browserOf} from './pages.mjs';

const {open, test, none, shot, scratch, end} = await browserOf(process.argv.slice(2));
const script = fs.readFileSync(path.join(scratch, 'charts.js'), 'utf8');
const axe = fs.readFileSync(path.join(scratch, 'node_modules', 'axe-core', 'axe.min.js'), 'utf8');

const linear = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
/** The contrast of WCAG 2. */
function contrast(a, b) {
  const [low, high] = [a, b].map((hex) => luminance(linear(hex))).sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
}
// What people with deuteranopia and protanopia see (Machado, Oliveira and Fernandes, 2009), and everybody else.
const EYES = [
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
  [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
];
function lab([r, g, b]) {
  const part = (value) => (value > 0.008856 ? Math.cbrt(value) : 7.787 * value + 16 / 116);
  const [x, y, z] = [(0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505, luminance([r, g, b]), (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089].map(part);
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}
/** The least distance of two colours in CIELAB, over all kinds of eyes. */
const difference = (a, b) => Math.min(...EYES.map((eye) => {
  const [p, q] = [a, b].map((hex) => lab(eye.map((row) => Math.min(1, Math.max(0, row.reduce((sum, k, i) => sum + k * linear(hex)[i], 0))))));
  return Math.hypot(...p.map((value, i) => value - q[i]));
}));

/** What axe-core finds, as "rule: element". */
async function violations(page) {
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, {resultTypes: ['violations']}));
  return found.violations.flatMap(({id, nodes}) => nodes.slice(0, 4).map((node) => `${id}: ${node.html.slice(0, 140)}: ${node.failureSummary.split('\n')[1] || ''}`));
}

for (const name of ['comparison', 'single', 'perception', 'hostile', 'experiment', 'worlds', 'acceptance']) {
  await test(`${name}: axe-core finds nothing, in light and dark, on desktop and phone`, async () => {
    for (const [colorSchemes, options] of [[['light', 'dark'], {}], [['light'], PHONE]]) {
      const {page, close} = await open(name, options);
      for (const colorScheme of colorSchemes) {
        await page.emulateMedia({colorScheme});
        await page.waitForSelector(`html[data-theme=${colorScheme}]`);
        await page.evaluate(() => document.querySelectorAll('details').forEach((node) => { node.open = true; }));
        assert.deepEqual(await violations(page), [], `${colorScheme}${options.viewport ? ', phone' : ''}`);
      }
      await close();
    }
  });
}

await test('colours: text has a contrast of 4.5:1, shapes of 3:1, and hues differ for the colour-blind', async () => {
  for (const colorScheme of ['light', 'dark']) {
    const {page, close} = await open('comparison', {colorScheme});
    const tokens = await page.evaluate(() => {
      const style = getComputedStyle(document.documentElement);
      const names = ['paper', 'raised', 'ink', 'soft', 'missed', 'met', 'delay', 'missed-back', 'met-back'];
      return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    });
    const [hues, shades] = [8, 3].map((count) => {
      const list = new RegExp(`${colorScheme}: \\[((?:'#[0-9a-f]{6}'(?:, )?){${count}})\\]`).exec(script)[1];
      return list.match(/#[0-9a-f]{6}/g);
    });
    const text = [['ink', 'paper'], ['ink', 'raised'], ['soft', 'paper'], ['soft', 'raised'], ['missed', 'paper'], ['missed', 'raised'], ['missed', 'missed-back'],
      ['met', 'paper'], ['met', 'met-back'], ['delay', 'paper'], ['delay', 'raised'], ['ink', 'missed-back'], ['ink', 'met-back']];
    assert.deepEqual(text.filter(([a, b]) => contrast(tokens[a], tokens[b]) < 4.5), [], colorScheme);
    assert.ok(hues.length === 8 && shades.length === 3);
    for (const look of [...hues, ...shades]) assert.ok(contrast(look, tokens.paper) >= 3, `${look} on ${tokens.paper}`);
    assert.ok(difference(tokens.missed, tokens.met) > 14);
    const meanings = ['missed', 'met', 'delay'].map((name) => tokens[name]);
    for (const [i, hue] of hues.entries()) {
      for (const other of hues.slice(i + 1)) assert.ok(difference(hue, other) > 14, `${hue} and ${other}: ${difference(hue, other)}`);
      for (const other of meanings) assert.ok(difference(hue, other) > 10, `${hue} means something else than ${other}: ${difference(hue, other)}`);
    }
    await close();
  }
});

await test('headline: the verdict is the first heading, and says whether deadlines were met', async () => {
  for (const [name, pattern] of [['comparison', /redag/], ['single', /deadline/], ['experiment', /on average: from/], ['acceptance', /Accepted workloads, on average: from/]]) {
    const {page, close} = await open(name);
    assert.match(await page.locator('main h2').first().innerText(), pattern);
    assert.equal(await page.locator('main h2').first().getAttribute('id'), 'verdict');
    await close();
  }
});

await test('keyboard: the first stop skips to the report, and the contents lead to a section', async () => {
  const {page, problems, close} = await open('comparison');
  await page.keyboard.press('Tab');
  assert.equal(await page.evaluate(() => document.activeElement.textContent), 'Skip to the report');
  await page.keyboard.press('Enter');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'report');
  const links = page.locator('nav.contents a');
  assert.ok(await links.count() >= 8);
  for (const target of ['schedule', 'tasks', 'why']) {
    const link = page.locator(`nav.contents a[href="#${target}"]`);
    await link.focus();
    await page.keyboard.press('Enter');
    const {top} = await page.locator(`#${target}`).evaluate((node) => node.getBoundingClientRect());
    assert.ok(top >= 0 && top < 200, `${target} is at ${top}`);
    assert.ok(await link.isVisible(), 'the contents stay in view');
  }
  none(problems);
  await close();
});

await test('sorting: by click and by key, both ways, and kept when the table is made again', async () => {
  const {page, problems, close} = await open('comparison');
  const box = page.locator('[data-table=Tasks]');
  const names = () => box.locator('tbody th').allInnerTexts();
  const asListed = await names();
  const head = (title) => box.locator('thead th', {hasText: title});
  await head('max lateness').getByRole('button').click();
  assert.equal(await head('max lateness').getAttribute('aria-sort'), 'descending');
  const down = await names();
  assert.notDeepEqual(down, asListed);
  await head('max lateness').getByRole('button').focus();
  await page.keyboard.press('Enter');
  assert.equal(await head('max lateness').getAttribute('aria-sort'), 'ascending');
  assert.deepEqual(await names(), [...down].reverse());
  await page.keyboard.press('Enter');
  assert.deepEqual(await names(), asListed, 'the third time gives the order as listed');
  await head('task').getByRole('button').press('Space');
  assert.deepEqual(await names(), [...asListed].sort());
  assert.equal(await head('max lateness').getAttribute('aria-sort'), 'none');
  await page.getByRole('button', {name: 'dark', exact: true}).click();
  assert.equal(await head('task').getAttribute('aria-sort'), 'ascending', 'a new theme keeps the order');
  none(problems);
  await close();
});

await test('the worst jobs: all misses are listed or counted, and a key explains one', async () => {
  const {page, problems, close} = await open('comparison');
  const document = JSON.parse(await page.locator('#data').textContent());
  const group = document.groups.findIndex(({label}) => label === 'ste');
  await page.getByRole('button', {name: 'ste', exact: true}).click();
  const {jobs, misses} = document.groups[group].why;
  assert.ok(misses > 12, 'there is something to fold');
  assert.equal(jobs.length, Math.min(misses, 400));
  const box = page.locator('[data-table="The worst jobs"]');
  const shown = await box.locator('tbody tr').count();
  const left = Number((await box.locator('p.row').innerText()).replace(/^.*; (.*) more.*$/s, '$1').replace(/\D/g, ''));
  assert.equal(shown + left, misses);
  await box.getByRole('button', {name: /^show/}).click();
  assert.equal(await box.locator('tbody tr').count(), jobs.length);
  const third = box.locator('tbody tr').nth(2);
  const name = await third.locator('th').innerText();
  await third.getByRole('button').focus();
  await page.keyboard.press('Enter');
  assert.equal(await page.evaluate(() => document.activeElement.textContent), name, 'the focus stays');
  assert.ok((await page.locator('p.job').innerText()).startsWith(name));
  assert.equal(await box.locator('tr[aria-current=true] th').innerText(), name);
  none(problems);
  await close();
});

await test('the wheel scrolls the page over every figure, and zooms only with Ctrl', async () => {
  const {page, problems, close} = await open('comparison');
  for (const name of FIGURES.comparison) {
    const figure = page.locator(`figure[data-figure=${name}] .chart`);
    await figure.evaluate((node) => window.scrollTo(0, node.getBoundingClientRect().top + window.scrollY - 200));
    await figure.hover({position: {x: 300, y: 120}});
    const before = await page.evaluate(() => window.scrollY);
    await page.mouse.wheel(0, 160);
    await page.waitForFunction((old) => window.scrollY !== old, before, {timeout: 5000});
  }
  const figure = page.locator('figure[data-figure=schedule] .chart');
  const drawn = async () => Buffer.from(await figure.screenshot()).toString('base64');
  await figure.hover({position: {x: 300, y: 100}});
  const whole = await drawn();
  await page.keyboard.down('Control');
  await page.mouse.wheel(0, -160);
  await page.keyboard.up('Control');
  await page.waitForTimeout(500);
  const before = await drawn();
  assert.notEqual(before, whole);
  await page.getByRole('button', {name: 'schedule: zoom in', exact: true}).click();
  const closer = await drawn();
  assert.notEqual(closer, before);
  await page.getByRole('button', {name: 'schedule: later', exact: true}).click();
  assert.notEqual(await drawn(), closer);
  none(problems);
  await close();
});

await end();
