// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Judges report.html of a comparison: a verdict, no error, and the numbers that comparison.json has.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import {browserOf} from './pages.mjs';

const {open, test, none, shot, scratch, end} = await browserOf(process.argv.slice(2));
const comparison = JSON.parse(fs.readFileSync(path.join(scratch, 'comparison.json'), 'utf8'));
/** The number at the beginning of a cell, whose digits stand in groups of three. */
const numberOf = (text) => Number(text.replace(/[\u202f\u00a0\s](?=\d{3})/g, '').match(/^\d+/)?.[0]);

await test('the page opens with a verdict, and logs no error', async () => {
  const {page, problems, close} = await open('report');
  assert.match(await page.locator('#verdict').innerText(), /\d/);
  await page.screenshot({path: shot('demo')});
  none(problems);
  await close();
});

await test('the page has the numbers of comparison.json', async () => {
  const {page, close} = await open('report');
  const table = page.getByRole('region', {name: 'Executors', exact: true}).or(page.locator('[aria-label=Executors]')).first();
  const rows = await table.locator('tbody tr').evaluateAll((lines) => lines.map((line) => [...line.cells].map((cell) => cell.innerText)));
  const wanted = comparison.executors[0].dags.flatMap(({name}) => comparison.executors.map((executor) => {
    const dag = executor.dags.find((one) => one.name === name);
    return [name, executor.name, dag.released, dag.late, dag.missed];
  }));
  assert.ok(wanted.length >= 3);
  const shown = rows.map(([name, executor, ...counts]) => [name.trim(), executor.trim(), ...counts.slice(0, 3).map(numberOf)]);
  assert.deepEqual(shown, wanted);
  await close();
});
await end();
