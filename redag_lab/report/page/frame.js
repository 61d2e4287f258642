// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The parts of every page: places that can be refilled, the verdict, the choice of theme, the footer, and the start.

const MARKS = {good: '\u2713', bad: '\u2717', caution: '!', plain: '\u2022'};
const verdictList = (sentences) => element('ul.verdict', {},
  ...sentences.map(({tone, text}) => element(`li.${tone}`, {}, element('b', {'aria-hidden': 'true'}, MARKS[tone]), text.replaceAll(' %', '\u00a0%'))));

/** Returns an element whose content is made again by refill(), which calls `fill`. */
function place(fill) {
  const node = element('div');
  node.refill = () => node.replaceChildren(...[].concat(fill()));
  return node;
}
const places = [];
function filled(fill) {
  const node = place(fill);
  places.push(node);
  return node;
}
const refill = () => places.forEach((node) => node.refill());

/** Returns buttons for the theme: the system's, light, dark. */
function themeChoice() {
  const names = ['auto', 'light', 'dark'];
  return choice(names, 0, (i) => {
    forced = i === 0 ? null : names[i];
    applyTheme();
  });
}

/** "redag 0.1.0 (revision 0123abc)". */
const programOf = ({version, revision}) => `redag ${version} (revision ${revision})`;

/** Returns the origin of results as rows of a description list. `provenance` is null in results of older versions. */
function provenanceRows(provenance) {
  if (!provenance) return [['Recorded', 'by an old version of redag, which did not record when, where and how']];
  const {created, host, kernel, command, calibration} = provenance;
  return [['Recorded', `${created}, by ${programOf(provenance)}`], ['Host', `${host}, ${kernel}`], ['Command line', element('code', {}, command)],
    ['Calibration', calibration]];
}

function pageFooter({version, provenance}) {
  const made = provenance ? [`Page made ${provenance.created} by ${programOf(provenance)} on ${provenance.host}: `, element('code', {}, provenance.command), '. ']
    : [`Page made by redag ${version}. `];
  return element('footer', {}, ...made, `Figures: Apache ECharts ${echarts.version} (Apache License 2.0). `
    + 'This file uses no network. Each figure can be saved as PNG or SVG with the buttons above it.');
}

/** Shows the page's nodes, without null ones, and draws its figures. */
function startPage(nodes) {
  document.documentElement.dataset.theme = themeName();
  themed.push(refill);
  document.getElementById('report').append(...nodes.filter((node) => node !== null));
  applyTheme();
  document.documentElement.dataset.ready = 'true';
}
