// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Opens report pages in Chromium. Every figure must be drawn. No error may be logged, nothing may be
// requested from the network or be wider than a phone, and hostile names must stay text. Leaves screenshots for
// inspection.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import {FIGURES, PHONE, browserOf} from './pages.mjs';

const {open, test, none, shot, scratch, end} = await browserOf(process.argv.slice(2));

/** How much each figure draws: shapes of an SVG, or distinct colours of a canvas. */
const drawn = (page) => page.evaluate(() => Object.fromEntries([...document.querySelectorAll('figure[data-figure]')].map((box) => {
  const svg = box.querySelector('.chart svg');
  if (svg) return [box.dataset.figure, [...svg.querySelectorAll('path')].filter((shape) => shape.getBBox().width + shape.getBBox().height > 0).length];
  const colours = new Set();
  for (const canvas of box.querySelectorAll('.chart canvas')) {
    const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 0) colours.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
  }
  return [box.dataset.figure, colours.size];
})));

async function assertAllDrawn(page, figures) {
  const counts = await drawn(page);
  assert.deepEqual(Object.keys(counts).sort(), [...figures].sort());
  for (const [name, count] of Object.entries(counts)) assert.ok(count >= 10, `figure ${name} is empty (${count})`);
}
/** The shapes and words of an SVG figure, without the names that ECharts makes anew for every drawing. */
const drawing = (page, name) => page.locator(`figure[data-figure=${name}] .chart`).evaluate((box) => [...box.querySelectorAll('svg path, svg text')]
  .map((shape) => [shape.getAttribute('d'), shape.getAttribute('transform'), shape.textContent].join(' ')).join('\n'));
/** Waits until the page is no wider than the screen: its figures follow a new width a moment later. */
const fits = (page) => page.waitForFunction(() => document.documentElement.scrollWidth <= window.innerWidth, null, {timeout: 20000});
const figureShot = (page, name, file) => page.locator(`figure[data-figure=${name}]`).screenshot({path: shot(file)});

for (const [name, figures] of Object.entries(FIGURES)) {
  await test(`${name}: every figure draws, without an error or a request`, async () => {
    const {page, problems, took, close} = await open(name);
    await assertAllDrawn(page, figures);
    await page.screenshot({path: shot(name), fullPage: true});
    for (const width of [1280, 768]) {
      await page.setViewportSize({width, height: 1024});
      await fits(page);
    }
    if (['comparison', 'single', 'experiment'].includes(name)) await page.screenshot({path: shot(`${name}-tablet`), fullPage: true});
    none(problems);
    const size = fs.statSync(path.join(scratch, `${name}.html`)).size;
    console.log(`         ${(size / 1e6).toFixed(2)} MB, ready after ${took} ms`);
    assert.ok(size < 10e6, 'a report is at most 10 MB');
    await close();
  });
}

await test('the first screen holds the verdict, one picture, and the worst misses with their causes', async () => {
  for (const name of ['comparison', 'single', 'perception']) {
    const {page, problems, close} = await open(name, {viewport: {width: 1280, height: 720}});
    const document = JSON.parse(await page.locator('#data').textContent());
    const missing = document.groups.filter(({why}) => why.misses > 0);
    assert.match(await page.locator('h2.headline').innerText(), name === 'comparison' ? /^redag missed none of its deadlines, mte [\d.]+.% and ste [\d.]+.%$/ : /./);
    const shown = name === 'comparison' ? ['h2.headline', 'figure[data-figure=missed] .chart', '.worst'] : ['h2.headline'];
    for (const what of shown) {
      const {y, height} = await page.locator(what).boundingBox();
      assert.ok(y + height <= 720, `${name}: ${what} ends at ${y + height}`);
    }
    assert.equal(await page.locator('.worst b', {hasText: 'Cause'}).count(), missing.length, name);
    for (const {why} of missing) {
      const said = await page.locator('.worst').innerText();
      assert.ok(said.includes(why.jobs[0].cause ?? 'lost at its release'), said);
    }
    none(problems);
    await close();
  }
});

await test('the schedule opens at the worst miss of the worst run, which a click on the first screen shows', async () => {
  const {page, problems, close} = await open('comparison', {viewport: {width: 1280, height: 900}});
  const {groups} = JSON.parse(await page.locator('#data').textContent());
  for (const [g, {label, why, runs, worst_run: worst, schedule}] of groups.entries()) {
    await page.getByRole('button', {name: label, exact: true}).click();
    assert.ok(runs[worst].missed === Math.max(...runs.map(({missed}) => missed)), label);
    const [from, to] = await page.locator('figure[data-figure=schedule]').evaluate(({dataset}) => [Number(dataset.from), Number(dataset.to)]);
    const {since_ns: released, task, number} = why.jobs[0];
    assert.ok(from <= released && released < to, `${label}: ${released} is not between ${from} and ${to}`);
    assert.deepEqual([schedule.views[0].task, schedule.views[0].job], [task, number]);
    assert.equal(await page.locator('h2#schedule ~ div p.soft').first().innerText(), `Of repetition-${worst + 1}, the worst of 3 runs.`);
    if (why.misses === 0) continue;
    await page.getByRole('button', {name: groups[0].label, exact: true}).click();
    await page.evaluate(() => window.scrollTo(0, 0));
    await page.locator('.worst > div').nth(g).getByRole('button').click();
    const {top} = await page.locator('#schedule').evaluate((node) => node.getBoundingClientRect());
    assert.ok(top >= 0 && top < 300, `the schedule is at ${top}`);
    assert.equal(await page.getByRole('button', {name: label, exact: true}).getAttribute('aria-pressed'), 'true');
    await figureShot(page, 'schedule', `first-look-${label}`);
  }
  none(problems);
  await close();
});

await test('shares end at 100 %, and no number stands on the range of its repetitions', async () => {
  const {page, problems, close} = await open('comparison');
  const look = (name) => page.locator(`figure[data-figure=${name}] .chart`).evaluate((box) => {
    const boxOf = (shape) => shape.getBoundingClientRect();
    const texts = [...box.querySelectorAll('svg text')].filter((text) => /\d\s?(%|\u00b5?[mn]?s)$/.test(text.textContent));
    const isTick = (text) => text.getAttribute('text-anchor') === 'end';
    const numbers = texts.filter((text) => !isTick(text)).map(boxOf);
    const lines = [...box.querySelectorAll('svg path')].filter((shape) => shape.getAttribute('stroke-width') === '1.2').map(boxOf);
    const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom - 1 && b.top < a.bottom - 1;
    const filled = [...box.querySelectorAll('svg path')].filter((shape) => !['none', 'transparent'].includes(shape.getAttribute('fill'))).map(boxOf);
    return {ticks: texts.filter(isTick).map((text) => text.textContent), numbers: numbers.length,
      ranges: lines.length, bars: filled.filter(({width, height}) => height > 20 && width > 8 && width < 80).length, overprinted: numbers.filter((number) => lines.some((line) => meet(number, line))).length};
  });
  const missed = await look('missed');
  assert.ok(missed.ticks.length > 2 && missed.ticks.every((tick) => parseFloat(tick) <= 100), missed.ticks.join(', '));
  assert.ok(missed.bars >= 2);
  assert.ok(missed.numbers >= 9 && missed.ranges > 0, `${missed.numbers} numbers, ${missed.ranges} lines of ranges`);
  assert.equal(missed.overprinted, 0);
  none(problems);
  await close();
});

await test('dark: figures and page follow the system, and the reader', async () => {
  const {page, problems, close} = await open('comparison', {colorScheme: 'dark'});
  const background = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const dark = await background();
  await assertAllDrawn(page, FIGURES.comparison);
  await page.screenshot({path: shot('dark'), fullPage: true});
  await page.getByRole('button', {name: 'light', exact: true}).click();
  assert.notEqual(await background(), dark);
  await page.getByRole('button', {name: 'auto', exact: true}).click();
  assert.equal(await background(), dark);
  await page.emulateMedia({colorScheme: 'light'});
  await page.waitForFunction((old) => getComputedStyle(document.body).backgroundColor !== old, dark, {timeout: 5000});
  await assertAllDrawn(page, FIGURES.comparison);
  none(problems);
  await close();
});

await test('phone: the page is not wider than the screen', async () => {
  for (const name of Object.keys(FIGURES)) {
    const {page, problems, close} = await open(name, PHONE);
    await fits(page);
    await assertAllDrawn(page, FIGURES[name]);
    if (['comparison', 'single', 'experiment', 'perception'].includes(name)) await page.screenshot({path: shot(`${name}-phone`), fullPage: true});
    none(problems);
    await close();
  }
});

await test('controls: each changes what it says', async () => {
  const {page, problems, close} = await open('comparison');
  const figure = (name) => page.locator(`figure[data-figure=${name}] .chart`);
  const pixels = async () => Buffer.from(await figure('schedule').screenshot()).toString('base64');
  const changes = async (read, act, what) => {
    const before = await read();
    await act();
    assert.notEqual(await read(), before, what);
  };
  const button = (name) => () => page.getByRole('button', {name, exact: true}).click();
  await changes(() => page.locator('h2#tasks ~ div .table').first().innerText(), button('ste'), 'an executor');
  await changes(pixels, () => page.getByLabel('show', {exact: true}).selectOption({index: 1}), 'a view');
  await figureShot(page, 'schedule', 'worst-job');
  await changes(pixels, button('schedule: zoom out'), 'zooming');
  await assertAllDrawn(page, FIGURES.comparison);
  none(problems);
  await close();
});

await test('why: the parts of a job sum to its time, and a click in the schedule explains that job', async () => {
  for (const [name, options] of [['comparison', {}], ['comparison', {colorScheme: 'dark'}], ['comparison', {viewport: {width: 390, height: 844}}]]) {
    const {page, problems, close} = await open(name, options);
    if (name === 'comparison') await page.getByRole('button', {name: 'ste', exact: true}).click();
    const panel = page.locator('p.job');
    const parts = await page.locator('p.job ~ .why tbody tr').evaluateAll((rows) => rows.map((row) => Number(row.cells[1].textContent.replace(/\D/g, ''))));
    const {groups} = JSON.parse(await page.locator('#data').textContent());
    assert.ok(parts.length > 1);
    assert.equal(parts.reduce((a, b) => a + b), groups.find(({label}) => label === 'ste').why.jobs[0].length_ns);
    assert.match(await panel.innerText(), /missed|skipped|aborted/);
    await page.locator('h2#why ~ div .table').first().scrollIntoViewIfNeeded();
    const view = options.colorScheme || (options.viewport ? 'phone' : 'light');
    await page.locator('h2#why').evaluate((node) => node.scrollIntoView());
    await page.screenshot({path: shot(`why-${view}`)});
    if (view !== 'phone') {
      // Somewhere in the schedule there is a job, whose name the panel or the note then states.
      await page.getByLabel('show', {exact: true}).selectOption({index: 1});
      const figure = page.locator('figure[data-figure=schedule] .chart');
      const {width} = await figure.boundingBox();
      let named = '';
      for (let x = 0.2; x < 0.95 && named === ''; x += 0.02) {
        await figure.hover({position: {x: width * x, y: 55}});
        await page.waitForTimeout(20);
        const tips = await page.locator('.tip:visible b').allInnerTexts();
        if (tips.length === 0) continue;
        await figure.click({position: {x: width * x, y: 55}});
        named = tips[0].replace(' ', '');
      }
      assert.notEqual(named, '', 'a job is under the pointer');
      const said = await page.locator('h2#why ~ div').allInnerTexts();
      assert.ok(said.some((text) => text.includes(named)), named);
    }
    none(problems);
    await close();
  }
});

await test('perception: the schedule shows which jobs a device serves', async () => {
  const {page, problems, close} = await open('perception');
  await figureShot(page, 'schedule', 'devices');
  const figure = page.locator('figure[data-figure=schedule] .chart');
  const {width, height} = await figure.boundingBox();
  let seen = '';
  for (let y = 49; y < height - 80 && !/gpu: /.test(seen); y += 30) {
    for (let x = 0.1; x < 0.95 && !/gpu: /.test(seen); x += 0.02) {
      await figure.hover({position: {x: width * x, y}});
      await page.waitForTimeout(5);
      seen = (await page.locator('.tip:visible').allInnerTexts()).join(' ');
    }
  }
  assert.match(seen, /(camera|lidar|map)\.[^]*gpu: /);
  none(problems);
  await close();
});

await test('experiment: each choice changes its figures', async () => {
  const {page, problems, close} = await open('experiment');
  const changes = async (act) => {
    const before = await drawing(page, 'curves');
    await act();
    assert.notEqual(await drawing(page, 'curves'), before);
  };
  const pick = (label, value) => () => page.getByLabel(label, {exact: true}).selectOption(value);
  await changes(pick('demand scale', '5'));
  await changes(pick('deadline scale', '1.2'));
  await changes(pick('DAG', 'dag2'));
  await changes(pick('of', 'p99 end to end'));
  await changes(pick('over', 'max active'));
  await figureShot(page, 'curves', 'experiment-over-bounds');
  await changes(pick('workers', '2'));
  await changes(pick('of', 'missed above the ideal'));
  assert.match(await page.locator('ul.verdict').innerText(), /no violation of the model[^]*Every max_active bound was kept/);
  const cell = await page.locator('.table tbody td.text').allInnerTexts();
  assert.deepEqual([...new Set(cell)].sort(), ['ideal', 'mte', 'redag', 'redag-none']);
  none(problems);
  await close();
});

await test('worlds: every row says where it ran, and the worlds of an executor are side by side', async () => {
  const {page, problems, close} = await open('worlds');
  const rows = await page.locator('.table tbody tr').evaluateAll((lines) => lines.slice(0, lines.length / 2)
    .map((line) => [...line.querySelectorAll('td.text')].map((cell) => cell.textContent).join(' in ')));
  assert.deepEqual(rows, ['ideal in virtual time', 'redag in virtual time', 'redag in threads', 'mte in virtual time', 'mte in threads', 'redag-none in threads']);
  assert.match(await page.locator('p.facts').innerText(), /in virtual time, on threads of this machine/);
  assert.match(await page.locator('ul.verdict').innerText(), /ideal, virtual time [^;]*; redag, virtual time [^;]*; redag, threads/);
  assert.match(await page.locator('h2#how ~ dl').innerText(), /threads\s+redag, mte, redag-none on threads of this machine/);
  const markup = () => drawing(page, 'worlds');
  for (const [name, value] of [['DAG', 'control'], ['of', 'p99 end to end'], ['demand scale', '0.5']]) {
    const before = await markup();
    await page.getByLabel(name, {exact: true}).selectOption(value);
    assert.notEqual(await markup(), before, name);
  }
  await figureShot(page, 'worlds', 'worlds-p99');
  none(problems);
  await close();
});

await test('legends end where the buttons begin', async () => {
  for (const [name, options] of [['comparison', {}], ['wide', {}], ['comparison', {viewport: {width: 390, height: 844}}]]) {
    const {page, close} = await open(name, options);
    const beside = await page.evaluate(() => [...document.querySelectorAll('figure[data-figure]')].flatMap((box) => {
      const buttons = box.querySelector('.tools')?.getBoundingClientRect();
      if (!buttons) return [];
      // A legend that has too little room is clipped and shows arrows.
      const end = (text) => {
        const clipped = text.closest('[clip-path]');
        const clip = clipped && document.querySelector(clipped.getAttribute('clip-path').slice(4, -1)).firstElementChild.getBBox();
        return Math.min(text.getBoundingClientRect().right, clip ? clipped.getScreenCTM().e + clip.x + clip.width : Infinity);
      };
      return [...box.querySelectorAll('.chart svg text')]
        .filter((text) => { const {top, bottom} = text.getBoundingClientRect(); return top < buttons.bottom && bottom > buttons.top; })
        .filter((text) => end(text) > buttons.left).map((text) => `${box.dataset.figure}: ${text.textContent}`);
    }));
    assert.deepEqual(beside, [], name);
    await close();
  }
});

await test('hostile names stay text, also in tooltips', async () => {
  const {page, problems, close} = await open('hostile');
  for (const [name, y] of [['schedule', 55]]) {
    const figure = page.locator(`figure[data-figure=${name}] .chart`);
    const {width} = await figure.boundingBox();
    let seen = '';
    for (let x = 0.1; x < 0.95 && seen === ''; x += 0.01) {
      await figure.hover({position: {x: width * x, y}});
      await page.waitForTimeout(10);
      seen = (await page.locator('.tip:visible').allInnerTexts()).join(' ');
    }
    assert.match(seen, /onerror|constructor/, `a tooltip shows in ${name}`);
  }
  assert.equal(await page.evaluate(() => window.attacked), undefined);
  assert.equal(await page.locator('img').count(), 0);
  assert.match(await page.locator('h1').innerText(), /^<\/script><script>/);
  none(problems);
  await close();
});

await end();
