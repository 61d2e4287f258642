// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Opens the page of redag serve in Chromium, with executors that run. What they do must be shown, no error may be
// logged, nothing may be requested elsewhere, nothing may be wider than a phone, and hostile names must stay text.
// Leaves screenshots for inspection.
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import {createInterface} from 'node:readline';
import {chromium} from 'playwright-core';

const [executable, redag, source, scratch] = process.argv.slice(2);
const shot = (name) => path.join(scratch, 'screenshots', `${name}.png`);
// A folder of its own, because other executors may run on this machine. Links to pages cannot leave /dev/shm.
const folder = fs.mkdtempSync('/dev/shm/redag-live-');
const children = [];

/** Starts an executor and links its page into the folder. */
async function start(workload) {
  const child = spawn(redag, ['run', workload, '--preemption', 'none', '--duration', '1h', '--json'], {stdio: 'ignore'});
  children.push(child);
  const page = `redag.${child.pid}.0`;
  while (!fs.existsSync(path.join('/dev/shm', page))) await new Promise((done) => { setTimeout(done, 20); });
  fs.linkSync(path.join('/dev/shm', page), path.join(folder, page));
  return {pid: child.pid, kill: () => new Promise((done) => { child.on('exit', done); child.kill('SIGKILL'); })};
}

const server = spawn(redag, ['serve', '--port', '0', '--interval', '500ms', '--folder', folder], {stdio: ['ignore', 'pipe', 'inherit']});
children.push(server);
const [address] = await new Promise((done) => { createInterface(server.stdout).once('line', (line) => done([line])); });
const origin = new URL(address).origin;

const browser = await chromium.launch({executablePath: executable, args: ['--no-sandbox', '--disable-gpu']});
let failures = 0;
async function test(name, body) {
  try {
    await body();
    console.log(`ok       ${name}`);
  } catch (error) {
    failures += 1;
    console.log(`FAILED   ${name}: ${error.message}`);
  }
}

/** Opens the page; `problems` collects what must not happen. */
async function open(options = {}) {
  const context = await browser.newContext({viewport: {width: 1280, height: 900}, colorScheme: 'light', ...options});
  context.setDefaultTimeout(120000);  // a busy machine
  const page = await context.newPage();
  const problems = [];
  page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) problems.push(message.text()); });
  page.on('pageerror', (error) => problems.push(String(error)));
  page.on('request', (request) => { if (!/^(data|blob):/.test(request.url()) && new URL(request.url()).origin !== origin) problems.push(`request: ${request.url()}`); });
  await page.goto(address);
  await page.waitForSelector('html[data-ready=true]');
  return {page, problems, close: () => context.close()};
}
const none = (problems) => assert.deepEqual(problems, []);
const TASKS = '[data-table="DAGs and tasks"]';
const names = (page) => page.locator(`${TASKS} tbody th`).allInnerTexts();
/** Waits until the table has more rows than this. */
const rowsOf = (page, count) => page.waitForFunction(([table, least]) => document.querySelectorAll(`${table} tbody tr`).length > least, [TASKS, count]);

await test('without a token there is no page', async () => {
  const context = await browser.newContext();
  const page = await context.newPage();
  assert.equal((await page.goto(`${origin}/`)).status(), 403);
  assert.equal((await page.goto(`${origin}/?token=${'0'.repeat(64)}`)).status(), 403);
  assert.doesNotMatch(await page.content(), /<main/);
  await context.close();
});

await test('without an executor the page waits for one', async () => {
  const {page, problems, close} = await open();
  assert.match(await page.locator('.facts').innerText(), /waits for one/);
  none(problems);
  await close();
});

const robot = await start(path.join(source, 'workloads', 'robot.yaml'));
await test('an executor is shown, and the token leaves the address', async () => {
  const {page, problems, close} = await open();
  assert.equal(page.url(), `${origin}/`);
  await rowsOf(page, 5);
  assert.equal(await page.locator('h1').innerText(), 'robot');
  assert.match(await page.locator('.facts').innerText(), new RegExp(`redag ${robot.pid}`));
  assert.equal(await page.locator('.state').innerText(), 'running');
  // Figures change, and the rows stay the same elements.
  await page.evaluate((table) => { window.firstRow = document.querySelector(`${table} tbody tr`); }, TASKS);
  const before = await page.locator('#headline').innerText();
  await page.waitForFunction((old) => document.querySelector('#headline').innerText !== old, before);
  assert.ok(await page.evaluate((table) => window.firstRow === document.querySelector(`${table} tbody tr`), TASKS));
  await page.waitForFunction(() => document.querySelectorAll('.worker').length > 0);
  await page.waitForTimeout(6000);
  await page.screenshot({path: shot('live'), fullPage: true});
  none(problems);
  await close();
});

/** The contrast of what a selector draws to the page, in WCAG 2. */
const contrast = (page, ...drawn) => page.evaluate(([selector, name]) => {  // at once: the page replaces its marks
  const luminance = (colour) => colour.match(/[\d.]+/g).slice(0, 3).map((part) => part / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)).reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const [low, high] = [getComputedStyle(document.querySelector(selector))[name], getComputedStyle(document.body).backgroundColor].map(luminance).sort((a, b) => a - b);
  return (high + 0.05) / (low + 0.05);
}, drawn);

await test('contrast: axe-core finds nothing, and marks can be seen, in light and dark', async () => {
  const axe = fs.readFileSync(path.join(scratch, 'node_modules', 'axe-core', 'axe.min.js'), 'utf8');
  for (const colorScheme of ['light', 'dark']) {
    const {page, problems, close} = await open({colorScheme});
    await page.waitForFunction(() => document.querySelectorAll('.bar > div').length > 0);
    await page.getByRole('button', {name: 'p99', exact: true}).click();
    for (const [selector, property] of [['th[aria-sort=descending] button', 'color'], ['.bar > div', 'backgroundColor']]) {
      const found = await contrast(page, selector, property);
      assert.ok(found >= 3, `${colorScheme}: ${selector} has a contrast of ${found.toFixed(2)}`);
    }
    await page.getByRole('searchbox').focus();
    assert.notEqual(await page.getByRole('searchbox').evaluate((node) => getComputedStyle(node).outlineStyle), 'none');
    await page.evaluate(axe);
    const {violations} = await page.evaluate(() => window.axe.run(document, {resultTypes: ['violations']}));
    assert.deepEqual(violations.flatMap(({id, nodes}) => nodes.slice(0, 4).map(({html}) => `${id}: ${html.slice(0, 140)}`)), [], colorScheme);
    none(problems);
    await close();
  }
});

await test('dark: the page follows the system, and the reader', async () => {
  const {page, problems, close} = await open({colorScheme: 'dark'});
  const background = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const dark = await background();
  await page.waitForTimeout(2500);
  await page.screenshot({path: shot('live-dark'), fullPage: true});
  await page.getByRole('button', {name: 'light', exact: true}).click();
  assert.notEqual(await background(), dark);
  none(problems);
  await close();
});

await test('phone: nothing is wider than the screen', async () => {
  const {page, problems, close} = await open({viewport: {width: 390, height: 844}, isMobile: true, hasTouch: true, deviceScaleFactor: 2});
  await page.waitForTimeout(2500);
  const width = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(width <= 390, `the page is ${width} wide`);
  await page.screenshot({path: shot('live-phone'), fullPage: true});
  none(problems);
  await close();
});

await test('controls: filter, order, DAGs only, since the start', async () => {
  const {page, problems, close} = await open();
  await rowsOf(page, 5);
  const all = await names(page);
  await page.getByRole('searchbox').fill('CONTROLLER');
  assert.deepEqual((await names(page)).map((name) => name.toLowerCase()).filter((name) => name.includes('controller')).length, 1);
  assert.ok((await names(page)).length < all.length);
  await page.getByRole('searchbox').fill('no such name');
  assert.deepEqual(await names(page), []);
  await page.getByRole('searchbox').fill('');
  await page.getByRole('button', {name: 'p99', exact: true}).click();
  assert.equal(await page.locator('th[aria-sort=descending]').innerText(), 'p99');
  assert.notDeepEqual(await names(page), all);
  await page.locator('button.sort', {hasText: 'p99'}).dblclick();  // whose name has an arrow now
  assert.deepEqual(await names(page), all, 'the third time gives the order as listed');
  await page.getByRole('button', {name: 'tasks', exact: true}).click();
  assert.ok((await names(page)).every((name) => name.includes('.')));
  await page.getByRole('button', {name: 'DAGs', exact: true}).click();
  assert.ok((await names(page)).every((name) => !name.includes('.')));
  await page.getByRole('button', {name: 'all', exact: true}).click();
  await page.getByRole('button', {name: 'since the start'}).click();
  assert.equal(await page.getByRole('button', {name: 'since the start'}).getAttribute('aria-pressed'), 'true');
  none(problems);
  await close();
});

// Links to a page and its processes stay until the end, so this executor comes after the tests that expect one only.
async function withDevices(options, body) {
  const perception = await start(path.join(source, 'workloads', 'perception.yaml'));
  const {page, problems, close} = await open(options);
  await page.waitForFunction(() => document.querySelectorAll('select option').length === 2);
  await page.getByLabel('executor', {exact: true}).selectOption(String(perception.pid));
  await page.waitForFunction(() => /^gpu [^ ]*[1-9]/.test(document.querySelector('#devices')?.innerText ?? ''));
  await body(page);
  none(problems);
  await close();
  await perception.kill();
  fs.rmSync(path.join(folder, `redag.${perception.pid}.0`), {force: true});
}

await test('devices have a sentence', () => withDevices({}, async (page) => {
  assert.match(await page.locator('#devices').innerText(), /^gpu .* busy, \d queued$/);
  const column = (await page.locator(`${TASKS} thead th`).allInnerTexts()).indexOf('away');
  assert.ok(column > 0);
  await page.waitForFunction(([table, i]) => [...document.querySelectorAll(`${table} tr.group`)].some((row) => row.children[i].innerText === '1'), [TASKS, column]);
  await page.screenshot({path: shot('live-devices'), fullPage: true});
}));

await test('devices on a phone: nothing is wider than the screen', () => withDevices({viewport: {width: 390, height: 844}, isMobile: true, hasTouch: true, deviceScaleFactor: 2}, async (page) => {
  const width = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(width <= 390, `the page is ${width} wide`);
  await page.screenshot({path: shot('live-devices-phone'), fullPage: true});
}));

const hostile = await start(path.join(source, 'tests', 'report', 'hostile.yaml'));
await test('several: one is chosen; names are text; one that is killed is said to have ended', async () => {
  const {page, problems, close} = await open();
  const picker = page.getByLabel('executor', {exact: true});
  await page.waitForFunction(() => document.querySelectorAll('select option').length === 2);
  await picker.selectOption(String(hostile.pid));
  await page.waitForFunction((pid) => document.querySelector('.facts').innerText.includes(`redag ${pid}`), hostile.pid);
  await rowsOf(page, 0);
  assert.equal(await page.locator('main img, main script, main iframe').count(), 0);
  await page.screenshot({path: shot('live-hostile'), fullPage: true});
  await hostile.kill();
  await page.waitForFunction(() => document.querySelector('.state').innerText === 'ended');
  assert.ok((await names(page)).length > 0, 'the last picture stays');
  await page.screenshot({path: shot('live-ended'), fullPage: true});
  await picker.selectOption(String(robot.pid));
  await page.waitForFunction(() => document.querySelector('h1').innerText === 'robot' && document.querySelector('.state').innerText === 'running');
  none(problems);
  await close();
});

await test('the end of redag serve is said', async () => {
  const {page, close} = await open();
  server.kill('SIGINT');
  const status = await new Promise((done) => { server.on('exit', done); });
  assert.equal(status, 0);
  await page.waitForFunction(() => document.querySelector('.state').innerText === 'no connection');
  await close();
});

for (const child of children) child.kill('SIGKILL');
fs.rmSync(folder, {recursive: true});
await browser.close();
process.exit(failures > 0 ? 1 : 0);
