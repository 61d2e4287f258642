// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the tests of report pages share: the pages and their figures, a browser, and the count of failures.
import assert from 'node:assert/strict';
import path from 'node:path';
import {pathToFileURL} from 'node:url';
import {chromium} from 'playwright-core';

export const FIGURES = {comparison: ['missed', 'schedule']};
FIGURES.experiment = ['curves'];
FIGURES.worlds = ['curves', 'worlds'];
FIGURES.executors = ['worlds'];
FIGURES.acceptance = ['curves'];
FIGURES.single = FIGURES.perception = FIGURES.hostile = FIGURES.long = FIGURES.wide = FIGURES.comparison.slice(1);

export const PHONE = {viewport: {width: 390, height: 844}, isMobile: true, hasTouch: true, deviceScaleFactor: 2};

/** Starts Chromium for the pages in the folder `scratch`. */
export async function browserOf([executablePath, scratch]) {
  const browser = await chromium.launch({executablePath, args: ['--no-sandbox', '--disable-gpu']});
  let failures = 0;

  /** Opens a page; `problems` collects what must not happen. */
  async function open(name, options = {}) {
    const context = await browser.newContext({viewport: {width: 1280, height: 900}, colorScheme: 'light', ...options});
    context.setDefaultTimeout(120000);  // a busy machine draws slowly
    const page = await context.newPage();
    const problems = [];
    const url = pathToFileURL(path.join(scratch, `${name}.html`)).href;
    page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) problems.push(message.text()); });
    page.on('pageerror', (error) => problems.push(String(error)));
    page.on('request', (request) => {
      const [address] = request.url().split('#');
      if (!/^(data|blob):/.test(address) && address !== url) problems.push(`request: ${address}`);
    });
    const began = Date.now();
    await page.goto(url);
    await page.waitForSelector('html[data-ready=true]', {timeout: 60000});
    return {page, problems, took: Date.now() - began, close: () => context.close()};
  }

  async function test(name, body) {
    const began = Date.now();
    try {
      await body();
      console.log(`ok       ${name}, ${Math.round((Date.now() - began) / 1000)} s`);
    } catch (error) {
      failures += 1;
      console.log(`FAILED   ${name}: ${error.message}`);
    }
  }

  return {
    open, test, scratch,
    none: (problems) => assert.deepEqual(problems, []),
    shot: (name) => path.join(scratch, 'screenshots', `${name}.png`),
    async end() {
      await browser.close();
      process.exit(failures > 0 ? 1 : 0);
    },
  };
}
