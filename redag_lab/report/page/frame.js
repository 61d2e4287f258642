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

function pageFooter({version, provenance}) {
  const made = provenance ? [`Page made ${provenance.created} by ${programOf(provenance)} on ${provenance.host}: `, element('code', {}, provenance.command), '. ']
    : [`Page made by redag ${version}. `];
  return element('footer', {}, ...made, `Figures: Apache ECharts ${echarts.version} (Apache License 2.0). `
    + 'This file uses no network. Each figure can be saved as PNG or SVG with the buttons above it.');
}

/** Returns links to all headings; the one of the section in view is current. */
function contents() {
  const headings = [...document.querySelectorAll('main h2[id], main h3[id]')];
  const links = headings.map((node) => element('a', {href: `#${node.id}`}, node.dataset.contents || node.textContent));
  const nav = element('nav.contents.controls', {'aria-label': 'Contents'}, element('ol', {},
    ...links.map((link, i) => element(headings[i].tagName === 'H3' ? 'li.sub' : 'li', {}, link))));
  let current = null;
  let waiting = false;
  function look() {
    waiting = false;
    const above = headings.filter((node) => node.getBoundingClientRect().top < 150);
    // At the end of the page the last sections cannot reach the top.
    const atEnd = window.scrollY > 0 && window.innerHeight + window.scrollY >= document.documentElement.scrollHeight - 2;
    const link = links[atEnd ? links.length - 1 : Math.max(0, above.length - 1)];
    if (link === current) return;
    if (current !== null) current.removeAttribute('aria-current');
    link.setAttribute('aria-current', 'location');
    current = link;
    const bar = nav.firstElementChild;
    bar.scrollLeft = link.offsetLeft - bar.clientWidth / 3;  // where the contents are a bar, the section stays in view
  }
  window.addEventListener('scroll', () => {
    if (!waiting) window.requestAnimationFrame(look);
    waiting = true;
  }, {passive: true});
  look();
  return nav;
}

/** Shows the page's nodes, without null ones, and draws its figures. */
function startPage(nodes) {
  document.documentElement.dataset.theme = themeName();
  themed.push(refill);
  const main = document.getElementById('report');
  main.append(...nodes.filter((node) => node !== null));
  main.before(element('a.skip.controls', {href: '#report'}, 'Skip to the report'));
  main.before(contents());
  applyTheme();
  document.documentElement.dataset.ready = 'true';
}
