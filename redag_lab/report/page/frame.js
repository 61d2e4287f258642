// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The parts of every page: contents, headline and verdict, places that can be refilled, the choice of theme, the
// footer, and the start.

const nbsp = (text) => text.replaceAll(' %', '\u00a0%');
const toneMark = (tone) => element('b', {'aria-hidden': 'true'}, TONES[tone]);
const verdictList = (sentences) => element('ul.verdict', {}, ...sentences.map(({tone, text}) => element(`li.${tone}`, {}, toneMark(tone), nbsp(text))));
const headlineParts = ({tone, text}) => [tone === 'plain' ? null : toneMark(tone), nbsp(text)];
const headline = (sentence) => element(`h2.headline.${sentence.tone}`, {id: 'verdict', tabindex: '-1', 'data-contents': 'Verdict'}, ...headlineParts(sentence));

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
  return choice('Theme', names, 0, (i) => {
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

/** Returns a description list of [name, value]. */
const factList = (rows) => element('dl', {}, ...rows.flatMap(([name, value]) => [element('dt', {}, name), element('dd', {}, value)]));

function pageFooter({version, provenance}) {
  const made = provenance ? [`Page made ${provenance.created} by ${programOf(provenance)} on ${provenance.host}: `, element('code', {}, provenance.command), '. ']
    : [`Page made by redag ${version}. `];
  return element('footer', {}, ...made, `Figures: Apache ECharts ${echarts.version} (Apache License 2.0). `
    + 'This file uses no network.');
}

/** Returns links to all headings. */
function contents() {
  const links = [...document.querySelectorAll('main h2[id], main h3[id]')].map((node) => element(node.tagName === 'H3' ? 'li.sub' : 'li', {},
    element('a', {href: `#${node.id}`}, node.dataset.contents || node.textContent)));
  return element('nav.contents.controls', {'aria-label': 'Contents'}, element('ol', {}, ...links));
}

/** Shows the page's nodes, without null ones, and draws its figures. */
function startPage(title, nodes) {
  document.title = `${title} - ReDAG-RT report`;
  document.documentElement.dataset.theme = themeName();
  themed.push(refill);
  const main = document.getElementById('report');
  main.append(...nodes.filter((node) => node !== null));
  main.before(element('a.skip.controls', {href: '#report'}, 'Skip to the report'));
  main.before(contents());
  applyTheme();
  document.documentElement.dataset.ready = 'true';
}
