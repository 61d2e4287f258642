// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ECharts on this page: one theme, light or dark. Each chart is redrawn when theme, width or data change, and can be
// saved as PNG and SVG.

const PALETTE = {
  light: ['#0b62c4', '#d9730d', '#2a8f4d', '#8e44ad', '#c2385a', '#0e8c99', '#8c6d1f', '#5a6270'],
  dark: ['#5aa9ff', '#ff9f45', '#5fd08a', '#c58af0', '#ff7f9e', '#4fd0dc', '#d9b95a', '#a9b4c0'],
};
const charts = [];
const themed = [];   // functions to call when the theme changes
let beforePrint = null;  // the state before printing, while printing
let forced = null;  // 'light' or 'dark' if the reader or the printer chose it

const systemDark = window.matchMedia('(prefers-color-scheme: dark)');
const themeName = () => forced || (systemDark.matches ? 'dark' : 'light');

function theme() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    dark: themeName() === 'dark', palette: PALETTE[themeName()], ink: colour('ink'), soft: colour('soft'), line: colour('line'),
    paper: colour('paper'), raised: colour('raised'), bad: colour('bad'), good: colour('good'), caution: colour('caution'),
  };
}
const colourOf = (t, index) => t.palette[index % t.palette.length];

function applyTheme() {
  document.documentElement.dataset.theme = themeName();
  themed.forEach((make) => make());
  charts.forEach((chart) => chart.draw());
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
    color: t.palette,
    ...option,
    xAxis: axes(option.xAxis),
    yAxis: axes(option.yAxis),
    legend: option.legend && {
      // The legend ends before the buttons, which are not printed. ECharts uses only one of left and right beside the
      // width.
      type: 'scroll', top: 0, left: 0, width: Math.max(120, width - (beforePrint === null ? 92 : 8)), icon: 'roundRect', itemWidth: 14, itemHeight: 10,
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
 * draw. `canvas` draws pixels instead of SVG, for many shapes. `onready(chart)` is called with every new chart.
 */
function figure({name, height, build, caption, canvas = false, label, onready}) {
  const place = element('div', {style: `height:${height}px`, role: 'img', 'aria-label': label});
  const box = element('figure', {'data-figure': name}, element('div.chart', {}, place),
    element('figcaption', {}, caption));
  let chart = null;
  let drawn = null;  // the option drawn
  let nothing = null;

  function save(kind) {
    const now = chart.getOption();  // includes the reader's zoom and legend selection
    const option = {...drawn, backgroundColor: theme().paper};
    if (drawn.dataZoom) option.dataZoom = now.dataZoom;
    if (drawn.legend) option.legend = {...drawn.legend, selected: now.legend[0].selected};
    download(`redag-${name}.${kind}`, pictureOf(option, kind, place.clientWidth, height));
  }
  box.prepend(element('span.save.controls', {}, ...['png', 'svg'].map((kind) => element('button', {
    type: 'button', title: `Save this figure as ${kind.toUpperCase()}`, 'aria-label': `${name} as ${kind}`, onclick: () => save(kind),
  }, kind.toUpperCase()))));

  const self = {
    box,
    chart: () => chart,
    resize(pixels) {
      height = pixels;
      place.style.height = `${pixels}px`;
    },
    draw() {
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
});
window.addEventListener('afterprint', () => {
  ({forced} = beforePrint);
  beforePrint = null;
  document.getElementById('report').style.width = '';
  applyTheme();
});
