// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ECharts on this page: one theme, light or dark. Each chart is redrawn when theme, width or data change, and can be
// saved as PNG and SVG. Its data can be read as a table.

// What a colour means, here and in page.css. Nothing is told by colour alone: marks, names, dashes and patterns say the
// same. No hue is near the red of misses, the green of what is met, or the orange of lost time, and all differ for
// people with deuteranopia or protanopia, too.
const HUES = {
  light: ['#1f66c1', '#922173', '#05a1c8', '#463b41', '#a77afa', '#9d6d96', '#3c2c9f', '#959389'],
  dark: ['#6cb2ff', '#c53c94', '#29e8e7', '#e3d7c6', '#a464cd', '#d98db7', '#3c6eee', '#827069'],
};
const SHADES = {light: ['#23394e', '#5c7489', '#8496a6'], dark: ['#e4edf5', '#a2b4c4', '#71869a']};
const DASHES = ['solid', 'dashed', 'dotted', [12, 4, 2, 4], [3, 3], [16, 6]];
const PATTERNS = ['none', 'lines', 'dots'];

const charts = [];
const themed = [];   // functions to call when the theme changes
let beforePrint = null;  // the state before printing, while printing
let forced = null;  // 'light' or 'dark' if the reader or the printer chose it
const isPrinting = () => beforePrint !== null;

const systemDark = window.matchMedia('(prefers-color-scheme: dark)');
const themeName = () => forced || (systemDark.matches ? 'dark' : 'light');

function theme() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    dark: themeName() === 'dark', ink: colour('ink'), soft: colour('soft'), line: colour('line'), paper: colour('paper'), raised: colour('raised'),
    missed: colour('missed'), met: colour('met'), delay: colour('delay'), hues: HUES[themeName()], shades: SHADES[themeName()],
  };
}

/** Returns the look of the i-th thing that is told apart by hue: {color, dash}. */
const hueOf = (t, i) => ({color: t.hues[i % t.hues.length], dash: DASHES[Math.floor(i / t.hues.length) % DASHES.length]});

/** Returns the look of the i-th thing that is told apart by shade and pattern: {color, dash, pattern}. */
function shadeOf(t, i) {
  const style = Math.floor(i / t.shades.length) % PATTERNS.length;
  return {color: t.shades[i % t.shades.length], dash: DASHES[style], pattern: PATTERNS[style]};
}

/** Returns the fill of a bar with such a look, for ECharts. */
function fillOf(t, {color, pattern}) {
  const common = {color: t.paper, backgroundColor: color};
  const decals = {lines: {...common, symbol: 'rect', dashArrayX: [1, 0], dashArrayY: [2, 4], rotation: Math.PI / 4},
    dots: {...common, symbol: 'circle', symbolSize: 0.7, dashArrayX: [[5, 5], [0, 5, 5, 0]], dashArrayY: [5, 0]}};
  return {color, decal: decals[pattern]};
}

/** Returns a square in such a look, for text. */
const swatch = ({color, pattern = 'none'}) => element(`span.swatch.${pattern}`, {style: `--look:${color}`, 'aria-hidden': 'true'});

/** Returns a name in its look. Long names break after a dot, a line or a slash. */
const named = (look, name) => element('span.named', {}, swatch(look), ...breakable(name));

/** Returns the list of what colours and lines mean. `hue` and `shade` name what they tell apart; null: nothing. */
function colourKey(hue, shade) {
  const mark = (kind) => element(`span.mark.${kind}`, {'aria-hidden': 'true'});
  const many = (looks) => element('span', {}, ...looks.slice(0, 3).map(swatch));
  const t = theme();
  const rows = [
    [mark('missed'), 'missed: late or lost, or a rule that was broken'], [mark('met'), 'met: no deadline missed, no rule broken'],
    [mark('delay'), 'time in which a job did not execute'],
    [mark('deadline'), 'dashed line: deadline'], [mark('bound'), 'dotted line: bound that the analysis proves'],
    hue && [many(t.hues.map((_, i) => hueOf(t, i))), `hue: ${hue}`, t.hues], shade && [many(t.shades.map((_, i) => shadeOf(t, i))), `shade and pattern: ${shade}`, t.shades],
  ];
  return element('ul.key', {}, ...rows.filter(Boolean).map(([sign, text, looks]) => element('li', {'data-looks': looks && looks.join(' ')}, sign, text)));
}

function applyTheme() {
  document.documentElement.dataset.theme = themeName();
  themed.forEach((make) => make());
  charts.forEach((chart) => chart.draw());
}

const BUTTONS_WIDTH = 210;
const NARROW = 560;  // where the buttons are above the figure (page.css)
const legendWidth = (width) => Math.max(120, width - (isPrinting() || width < NARROW ? 8 : BUTTONS_WIDTH));

/** Returns the height that a printed legend needs beyond its first line. */
function legendHeight(option, width) {
  if (!option.legend || !isPrinting()) return 0;
  const names = [...new Set(option.series.map(({name}) => name).filter(Boolean))];
  let lines = 1;
  let at = 0;
  for (const name of names) {
    const wide = 34 + 6.6 * Math.min(42, name.length);
    if (at > 0 && at + wide > legendWidth(width)) {
      lines += 1;
      at = 0;
    }
    at += wide;
  }
  return 19 * (lines - 1);
}

// Adds the page's text, axes and tooltips to an option. The figure's own values take precedence.
function withTheme(option, t, width) {
  const axis = (own) => ({
    ...own,
    axisLine: {show: true, lineStyle: {color: t.line}, ...own.axisLine},
    axisTick: {lineStyle: {color: t.line}, ...own.axisTick},
    axisLabel: {color: t.soft, hideOverlap: true, ...own.axisLabel},
    splitLine: {lineStyle: {color: t.line, opacity: 0.6}, ...own.splitLine},
    nameTextStyle: {color: t.soft, ...own.nameTextStyle},
  });
  const axes = (own) => (Array.isArray(own) ? own.map(axis) : axis(own));
  return {
    animation: false,
    // ECharts writes the names into a saved SVG between double quotes, without escaping.
    textStyle: {fontFamily: "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif"},
    ...option,
    xAxis: axes(option.xAxis),
    yAxis: axes(option.yAxis),
    legend: option.legend && {
      // The legend ends before the buttons. Paper has no buttons, and no pages of a legend. ECharts uses only one of left
      // and right beside the width.
      type: isPrinting() ? 'plain' : 'scroll', top: 0, left: 0, width: legendWidth(width), icon: 'roundRect', itemWidth: 14, itemHeight: 10,
      formatter: (name) => (name.length > 42 ? `${name.slice(0, 41)}\u2026` : name), textStyle: {color: t.ink},
      pageTextStyle: {color: t.soft}, pageIconColor: t.ink, inactiveColor: t.line, ...option.legend,
    },
    tooltip: option.tooltip && {
      backgroundColor: t.raised, borderColor: t.line, textStyle: {color: t.ink}, confine: true, ...option.tooltip,
    },
  };
}

function download(name, blob) {
  const url = URL.createObjectURL(blob);
  const link = element('a', {href: url, download: name});
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 60000);  // a busy browser starts to read the URL late
}

// Returns a picture of `option` as a Blob.
function pictureOf(option, kind, width, height) {
  const plain = {...option, animation: false};
  if (kind === 'svg') {
    const drawing = echarts.init(null, null, {renderer: 'svg', ssr: true, width, height});
    drawing.setOption(plain);
    const text = drawing.renderToSVGString();
    drawing.dispose();
    return new Blob([text], {type: 'image/svg+xml'});
  }
  const place = element('div', {style: `width:${width}px;height:${height}px`});
  const drawing = echarts.init(place, null, {renderer: 'canvas', width, height, devicePixelRatio: 3});
  drawing.setOption(plain);
  const url = drawing.getDataURL({type: 'png', pixelRatio: 3, backgroundColor: option.backgroundColor});
  drawing.dispose();
  // Browsers limit the length of data URLs that they save.
  const bytes = atob(url.slice(url.indexOf(',') + 1));
  return new Blob([Uint8Array.from(bytes, (byte) => byte.charCodeAt(0))], {type: 'image/png'});
}

/**
 * Returns a figure. `build(t, width)` returns an ECharts option for theme `t`, or a sentence if there is nothing to
 * draw. `data()` returns what it shows as {columns, rows} of a table. `canvas` draws pixels instead of SVG, for many
 * shapes. `onready(chart)` is called with every new chart. A figure with a dataZoom gets buttons for it.
 */
function figure({name, height, build, data, caption, canvas = false, label, onready, zooms = false}) {
  const place = element('div', {style: `height:${height}px`, role: 'img', 'aria-label': label});
  const values = element('details.data', {ontoggle: () => fillData()}, element('summary', {}, 'Data of this figure'), element('div'));
  const box = element('figure', {'data-figure': name}, element('div.chart', {}, place), element('figcaption', {}, caption), data ? values : null);
  // The wheel belongs to the page. ECharts would take it for every figure that can zoom, even where it does nothing.
  for (const wheel of ['wheel', 'mousewheel']) {
    place.addEventListener(wheel, (event) => { if (!event.ctrlKey) event.stopPropagation(); }, {capture: true, passive: true});
  }
  let chart = null;
  let drawn = null;  // the option drawn
  let nothing = null;

  function fillData() {
    if (!data || !values.open) return;
    const {columns, rows} = data();
    values.lastElementChild.replaceChildren(table(`${label}: data`, columns, rows));
  }
  function save(kind) {
    const now = chart.getOption();  // includes the reader's zoom and legend selection
    const option = {...drawn, backgroundColor: theme().paper};
    if (drawn.dataZoom) option.dataZoom = now.dataZoom;
    if (drawn.legend) option.legend = {...drawn.legend, selected: now.legend[0].selected};
    download(`redag-${name}.${kind}`, pictureOf(option, kind, place.clientWidth, height));
  }
  const tool = (text, what, act) => element('button', {type: 'button', title: what, 'aria-label': `${name}: ${what}`, onclick: () => { if (chart) act(); }}, text);
  box.prepend(element('span.tools.controls', {role: 'group', 'aria-label': `${label}: tools`},
    ...(zooms ? [tool('\u2190', 'earlier', () => self.zoom(1, -0.5)), tool('\u2192', 'later', () => self.zoom(1, 0.5)),
      tool('+', 'zoom in', () => self.zoom(2, 0)), tool('\u2212', 'zoom out', () => self.zoom(0.5, 0))] : []),
    ...['png', 'svg'].map((kind) => tool(kind.toUpperCase(), `save as ${kind.toUpperCase()}`, () => save(kind)))));

  const self = {
    box,
    chart: () => chart,
    resize(pixels) {
      height = pixels;
      place.style.height = `${pixels}px`;
    },
    /** Shows 1/factor of what is shown now, moved by a share of it. */
    zoom(factor, shift) {
      const {start, end} = chart.getOption().dataZoom[0];
      const length = Math.min(100, (end - start) / factor);
      const begin = Math.max(0, Math.min(100 - length, (start + end - length) / 2 + shift * length));
      chart.dispatchAction({type: 'dataZoom', start: begin, end: begin + length});
    },
    draw() {
      fillData();
      const width = place.clientWidth;
      if (width === 0) return;
      const t = theme();
      const option = build(t, width);
      if (chart !== null) chart.dispose();
      chart = null;
      if (nothing !== null) nothing.remove();
      nothing = null;
      place.style.display = '';
      if (typeof option === 'string') {
        nothing = element('p.soft', {}, option);
        place.after(nothing);
        place.style.display = 'none';
        return;
      }
      const extra = legendHeight(option, width);
      place.style.height = `${height + extra}px`;
      if (extra > 0) option.grid = [].concat(option.grid).map((grid) => ({...grid, top: grid.top + extra}));
      chart = echarts.init(place, null, {renderer: canvas ? 'canvas' : 'svg', devicePixelRatio: Math.max(2, window.devicePixelRatio)});
      drawn = withTheme(option, t, width);
      chart.setOption(drawn);
      if (onready) onready(chart);
    },
  };
  charts.push(self);
  return self;
}

let lastWidth = window.innerWidth;
window.addEventListener('resize', () => {
  if (window.innerWidth === lastWidth) return;  // on a phone the height changes with the address bar
  lastWidth = window.innerWidth;
  charts.forEach((chart) => chart.draw());
});
systemDark.addEventListener('change', applyTheme);
// Paper is white, and narrower than most windows.
window.addEventListener('beforeprint', () => {
  beforePrint = {forced};
  forced = 'light';
  document.getElementById('report').style.width = '700px';
  applyTheme();
  refillTables();
});
window.addEventListener('afterprint', () => {
  ({forced} = beforePrint);
  beforePrint = null;
  document.getElementById('report').style.width = '';
  applyTheme();
  refillTables();
});
