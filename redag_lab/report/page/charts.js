// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ECharts on this page: one theme, light or dark. Each chart is redrawn when theme, width or data change.

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
let forced = null;  // 'light' or 'dark' if the reader chose it

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

function applyTheme() {
  document.documentElement.dataset.theme = themeName();
  themed.forEach((make) => make());
  charts.forEach((chart) => chart.draw());
}

const BUTTONS_WIDTH = 140;
const NARROW = 560;  // where the buttons are above the figure (page.css)

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
    textStyle: {fontFamily: "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif"},
    ...option,
    xAxis: axes(option.xAxis),
    yAxis: axes(option.yAxis),
    legend: option.legend && {
      // The legend ends before the buttons. ECharts uses only one of left and right beside the width.
      type: 'scroll', top: 0, left: 0, width: Math.max(120, width - (width < NARROW ? 8 : BUTTONS_WIDTH)), icon: 'roundRect', itemWidth: 14, itemHeight: 10,
      formatter: (name) => (name.length > 42 ? `${name.slice(0, 41)}\u2026` : name), textStyle: {color: t.ink},
      pageTextStyle: {color: t.soft}, pageIconColor: t.ink, inactiveColor: t.line, ...option.legend,
    },
    tooltip: option.tooltip && {
      backgroundColor: t.raised, borderColor: t.line, textStyle: {color: t.ink}, confine: true, ...option.tooltip,
    },
  };
}

/**
 * Returns a figure. `build(t, width)` returns an ECharts option for theme `t`, or a sentence if there is nothing to
 * draw. `canvas` draws pixels instead of SVG, for many shapes. `onready(chart)` is called with every new chart. `zooms`:
 * buttons for its dataZoom.
 */
function figure({name, height, build, caption, canvas = false, label, onready, zooms = false}) {
  const place = element('div', {style: `height:${height}px`, role: 'img', 'aria-label': label});
  const nothing = element('p.soft');
  const box = element('figure', {'data-figure': name}, element('div.chart', {}, place, nothing), element('figcaption', {}, caption));
  // The wheel belongs to the page. ECharts would take it for every figure that can zoom, even where it does nothing.
  for (const wheel of ['wheel', 'mousewheel']) {
    place.addEventListener(wheel, (event) => { if (!event.ctrlKey) event.stopPropagation(); }, {capture: true, passive: true});
  }
  let chart = null;

  const tool = (text, what, act) => element('button', {type: 'button', title: what, 'aria-label': `${name}: ${what}`, onclick: () => { if (chart) act(); }}, text);
  if (zooms) {
    box.prepend(element('span.tools.controls', {role: 'group', 'aria-label': `${label}: tools`},
      tool('\u2190', 'earlier', () => self.zoom(1, -0.5)), tool('\u2192', 'later', () => self.zoom(1, 0.5)),
      tool('+', 'zoom in', () => self.zoom(2, 0)), tool('\u2212', 'zoom out', () => self.zoom(0.5, 0))));
  }

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
      if (box.clientWidth === 0) return;
      const t = theme();
      const option = build(t, box.clientWidth);
      if (chart !== null) chart.dispose();
      chart = null;
      const isEmpty = typeof option === 'string';
      nothing.textContent = isEmpty ? option : '';
      place.style.display = isEmpty ? 'none' : '';
      if (isEmpty) return;
      chart = echarts.init(place, null, {renderer: canvas ? 'canvas' : 'svg', devicePixelRatio: Math.max(2, window.devicePixelRatio)});
      chart.setOption(withTheme(option, t, box.clientWidth));
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
