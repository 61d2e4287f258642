// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Takes the pictures of pages that the documentation shows, or compares them with the pages as they are now. The pages
// of runs are of virtual time, and the live page shows a recorded state (live.json): the same program draws the same.
//   pictures.mjs CHROMIUM SCRATCH REDAG SOURCE check|take|record      record: takes them, with new states of a run
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import {createInterface} from 'node:readline';
import {pathToFileURL} from 'node:url';
import {chromium} from 'playwright-core';

const [executablePath, scratch, redag, source, task] = process.argv.slice(2);
const states = path.join(source, 'tests', 'report', 'live.json');
const PICTURES = {report: [1280, 900], experiment_report: [1280, 900], serve: [1280, 1180]};
const PAGES = {report: 'comparison', experiment_report: 'experiment'};
const CELL = 16;          // pixels; a glyph is smaller
const NEAR = 16;          // of 255, by which the mean colour of a cell may differ
const MOST_DIFFERENT = 0.03;  // of the cells: another font differs in 2 % of them, a section that is missing in 6 %

const browser = await chromium.launch({executablePath, args: ['--no-sandbox', '--disable-gpu']});
const children = [];
function start(...words) {
  const child = spawn(redag, words, {stdio: ['ignore', 'pipe', 'ignore']});
  children.push(child);
  return child;
}

/** Starts redag serve, which watches `folder`, and returns its address. */
async function serve(folder) {
  const server = start('serve', '--port', '0', '--interval', '1s', '--folder', folder);
  return new Promise((done) => { createInterface(server.stdout).once('line', done); });
}

async function opened(address, [width, height], isReplayed = false) {
  const page = await browser.newPage({viewport: {width, height}, colorScheme: 'light'});
  if (isReplayed) await page.addInitScript(replay, JSON.parse(fs.readFileSync(states, 'utf8')));
  await page.goto(address);
  await page.waitForSelector('html[data-ready=true]', {timeout: 60000});
  return page;
}

/** Records what redag serve sends about a run: its last state. */
async function record(seconds) {
  const folder = fs.mkdtempSync('/dev/shm/redag-pictures-');
  const run = start('run', path.join(source, 'workloads', 'robot.yaml'), '--duration', '1h', '--json');
  const live = `redag.${run.pid}.0`;
  while (!fs.existsSync(path.join('/dev/shm', live))) await new Promise((done) => { setTimeout(done, 20); });
  fs.linkSync(path.join('/dev/shm', live), path.join(folder, live));
  const page = await opened(await serve(folder), PICTURES.serve);
  const recorded = await page.evaluate((wanted) => new Promise((done) => {
    let count = 0;
    const events = new EventSource('events');
    events.onmessage = ({data}) => {
      const state = JSON.parse(data);
      if (state.frame === null) return;
      count += 1;
      if (count === wanted) done(state);
    };
  }), seconds);
  await page.close();
  fs.rmSync(folder, {recursive: true});
  fs.writeFileSync(states, `${JSON.stringify(recorded)}\n`);
}

/** Replaces the connection to the server by the recorded state. */
function replay(state) {
  window.EventSource = class {
    constructor() {
      setTimeout(() => this.onmessage({data: JSON.stringify(state)}));
    }

    close() {}
  };
}

async function picture(name) {
  const address = name === 'serve' ? await serve(scratch) : pathToFileURL(path.join(scratch, `${PAGES[name]}.html`)).href;
  const page = await opened(address, PICTURES[name], name === 'serve');
  await page.waitForTimeout(500);
  assert.doesNotMatch(await page.locator('main').innerText(), /undefined|NaN/);
  const bytes = await page.screenshot();
  await page.close();
  return bytes;
}

/** Returns the share of cells whose colours differ; 1 if the pictures differ in size. */
async function difference(before, now) {
  const page = await browser.newPage();
  const share = await page.evaluate(async ([pictures, cell, near]) => {
    const cells = await Promise.all(pictures.map(async (url) => {
      const image = new Image();
      image.src = url;
      await image.decode();
      const [width, height] = [image.width, image.height].map((size) => Math.ceil(size / cell));
      const canvas = new OffscreenCanvas(width, height);
      const context = canvas.getContext('2d');
      context.imageSmoothingQuality = 'high';
      context.drawImage(image, 0, 0, width, height);
      return context.getImageData(0, 0, width, height);
    }));
    const [a, b] = cells;
    if (a.width !== b.width || a.height !== b.height) return 1;
    let different = 0;
    for (let i = 0; i < a.data.length; i += 4) {
      if ([0, 1, 2].some((k) => Math.abs(a.data[i + k] - b.data[i + k]) > near)) different += 1;
    }
    return different / (a.data.length / 4);
  }, [[before, now].map((bytes) => `data:image/png;base64,${bytes.toString('base64')}`), CELL, NEAR]);
  await page.close();
  return share;
}

let failures = 0;
try {
  if (task === 'record') await record(60);
  for (const name of Object.keys(PICTURES)) {
    const file = path.join(source, 'docs', 'images', `${name}.png`);
    const now = await picture(name);
    if (task !== 'check') {
      fs.writeFileSync(file, now);
      console.log(`wrote    docs/images/${name}.png`);
      continue;
    }
    fs.writeFileSync(path.join(scratch, 'screenshots', `picture-${name}.png`), now);
    const share = await difference(fs.readFileSync(file), now);
    const isNear = share <= MOST_DIFFERENT;
    if (!isNear) failures += 1;
    console.log(`${isNear ? 'ok      ' : 'FAILED  '} docs/images/${name}.png, ${(100 * share).toFixed(1)} % of it differ${isNear ? '' : '; tools/pictures takes it anew'}`);
  }
} finally {
  for (const child of children) child.kill('SIGKILL');
  await browser.close();
}
process.exit(failures > 0 ? 1 : 0);
