// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The page of an experiment: executors, or methods of the analysis, over any factor at chosen levels of the others, and a
// map of the bounds of two DAGs.

const report = JSON.parse(document.getElementById('data').textContent);
const {factors} = report;
// Each level of the last factor has a line: executors, or methods.
const EXECUTOR = factors[factors.length - 1].name;
const isRuns = EXECUTOR === 'executor';
// The rows of each combination, one for each DAG; the last one is of all DAGs together.
const points = [];
report.rows.forEach(({at, labels, counts, confidence, values}) => {
  const [world, , dag] = isRuns ? labels : ['', '', 'total'];
  const last = points[points.length - 1];
  const key = JSON.stringify(at);
  if (last === undefined || last.key !== key) points.push({key, at, worlds: isRuns ? [world] : [], dags: []});
  points[points.length - 1].dags.push({name: dag, released: counts[0], missed: counts[1], confidence, values});
});
// The world of each executor. One experiment can have runs of several worlds, as executors "mte", "threads/mte",
// "ros2/mte".
const worldOf = new Map(factors.find(({name}) => name === EXECUTOR).levels.map((executor) => [executor,
  (points.find(({at, worlds}) => at[EXECUTOR] === executor && worlds.length > 0) || {worlds: []}).worlds[0]]));
const worlds = Object.keys(WORLDS).filter((world) => [...worldOf.values()].includes(world));
const plainName = (executor) => executor.slice(executor.indexOf('/') + 1);
const label = (executor) => (worlds.length > 1 ? `${plainName(executor)}, ${WORLDS[worldOf.get(executor)]}` : executor);
// Sorts executors so that the worlds of one executor are side by side.
const plainNames = [...new Set([...worldOf.keys()].map(plainName))];
const executors = [...worldOf.keys()].sort((a, b) => plainNames.indexOf(plainName(a)) - plainNames.indexOf(plainName(b))
  || worlds.indexOf(worldOf.get(a)) - worlds.indexOf(worldOf.get(b)));
const byWorld = (list) => worlds.map((world) => ({world, names: list.filter((executor) => worldOf.get(executor) === world)}));
const varied = factors.filter(({name, levels}) => name !== EXECUTOR && levels.length > 1);
const pairs = (factors.find(({name}) => name === 'max_active') || {levels: []}).levels.filter((level) => /^\d+\+\d+$/.test(level));

const METRICS = {
  accepted_ratio: 'accepted',
  miss_ratio: 'missed: late, skipped or aborted',
  drop_ratio: 'skipped',
  excess_miss_ratio: 'missed above the ideal',
  response_p50_ns: 'median end to end',
  response_p95_ns: 'p95 end to end',
  response_p99_ns: 'p99 end to end',
  response_max_ns: 'longest end to end, of all runs',
  max_lateness_ns: 'largest lateness, of all runs',
  paper_miss_ratio: 'missed, counted as in the paper',
  paper_startup_miss_ratio: 'missed, counted as in the paper with an early epoch',
  paper_max_lateness_ns: 'largest lateness, counted as in the paper',
  finished_per_s: 'finished jobs per second',
  work: 'processors in use',
};
// Returns the reason why a figure is empty.
const nothing = (metric) => (!isRuns ? 'No method applies.' : metric.startsWith('response_') ? 'A response time belongs to one DAG, end to end: choose a DAG. (A DAG that never finished has none.)'
  : 'There is no data: the distance to the ideal needs runs of the executor "ideal" with the same workers and jobs.');
const isTime = (metric) => metric.endsWith('_ns');
const isShare = (metric) => metric.endsWith('_ratio');
const show = (metric, value) => (isTime(metric) ? formatTime(value) : isShare(metric) ? formatPercent(value) : String(value));
const words = (name) => name.replaceAll('_', ' ');

// The reader's choice: a level of each factor, the factor along the axis, a metric, a DAG, and the executor of the map.
const state = {x: Math.max(0, varied.findIndex(({name}) => (isRuns ? name !== 'workload' : name === 'utilization'))), metric: report.figures[0], dag: 'total', levels: {}, owner: 0};
varied.forEach(({name, levels}) => { state.levels[name] = levels.includes('unbounded') ? 'unbounded' : levels[levels.length > 2 ? Math.floor(levels.length / 2) : 0]; });

const byPlace = new Map(points.map((point) => [factors.map(({name}) => point.at[name] ?? '').join('\n'), point]));
// The factors that affect each executor. Other factors are not in the places of its points.
const knows = new Map(executors.map((executor) => [executor, new Set(points.filter((point) => point.at[EXECUTOR] === executor)
  .flatMap((point) => Object.keys(point.at)))]));

/**
 * Returns a DAG's row of an executor at the chosen levels, some of them replaced by `other`; null if it did not run.
 */
function dagAt(executor, other = {}) {
  const place = factors.map(({name, levels}) => {
    if (name === EXECUTOR) return executor;
    if (!knows.get(executor).has(name)) return '';
    return other[name] ?? state.levels[name] ?? levels[0];
  }).join('\n');
  const point = byPlace.get(place);
  return (point && (point.dags.find(({name}) => name === state.dag) || point.dags[point.dags.length - 1])) || null;
}

/** Returns [median, low, high] of the metric; for a maximum [largest of all runs, least, largest]. */
function spreadAt(executor, metric, other = {}) {
  const dag = dagAt(executor, other);
  return dag === null ? null : dag.values[report.figures.indexOf(metric)];
}

const where = (skip) => varied.filter(({name}) => !skip.includes(name)).map(({name}) => `${words(name)} ${state.levels[name]}`).join(', ');

/** Returns a figure's data: rows of [first, executor, spread]. */
function spreadTable(first, metric, rows) {
  const number = (value) => ({text: show(metric, value), sort: value});
  return {
    columns: [column(first), column(EXECUTOR, '', true), column(METRICS[metric]), column('least'), column('most')],
    rows: rows.filter(([, , spread]) => spread).map(([at, name, spread]) => ({cells: [{text: at, sort: Number.isNaN(Number(at)) ? at : Number(at)}, name, ...spread.map(number)]})),
  };
}

/** Draws a metric over the chosen factor, with a line for each executor. */
function curvesFigure(name, metricOf, caption) {
  return figure({
    name, height: 348, label: `${name === 'distance' ? 'Distance to the ideal' : 'A metric'} over a factor, by executor`, caption,
    data() {
      const factor = varied[state.x];
      const metric = metricOf();
      return spreadTable(words(factor.name), metric, factor.levels.flatMap((level) => executors.map((executor) => [level, label(executor), spreadAt(executor, metric, {[factor.name]: level})])));
    },
    build(t, width) {
      const factor = varied[state.x];
      const metric = metricOf();
      // Widely spread numbers are placed to scale; a few close ones are evenly spaced.
      const numbers = factor.levels.map(Number);
      const numeric = factor.numeric && factor.levels.length > 3 && numbers[0] <= numbers[numbers.length - 1] / 2;
      const x = (i) => (numeric ? numbers[i] : i);
      const lines = executors.map((executor, e) => ({executor, e, values: factor.levels.map((level, i) => {
        const spread = spreadAt(executor, metric, {[factor.name]: level});
        return spread && [x(i), ...spread];
      }).filter((value) => value !== null)})).filter(({values}) => values.length > 0);
      if (lines.length === 0) return nothing(metric);
      const symbols = ['circle', 'rect', 'triangle', 'diamond', 'emptyCircle', 'emptyRect', 'emptyTriangle', 'emptyDiamond'];
      const most = Math.max(...lines.flatMap(({values}) => values.map((value) => value[1])));
      return {
        grid: {left: 8, right: 24, top: 60, bottom: 34, containLabel: true},
        legend: {},
        tooltip: {
          trigger: 'item',
          formatter: ({seriesName, value}) => tip([seriesName, `${words(factor.name)} ${numeric ? value[0] : factor.levels[value[0]]}`, show(metric, value[1]),
            value[2] === value[3] ? null : `${show(metric, value[2])} to ${show(metric, value[3])}`]),
        },
        xAxis: {
          ...(numeric ? {type: 'value', min: 0, max: numbers[numbers.length - 1], splitNumber: width < 500 ? 4 : 8}
            : {type: 'category', data: factor.levels}),
          name: `${words(factor.name)}${factor.name === 'utilization' ? ' per worker' : ''}`, nameLocation: 'middle', nameGap: 32,
        },
        yAxis: {
          type: 'value', name: METRICS[metric], nameTextStyle: {align: 'left'}, nameGap: 14, max: most === 0 ? 1 : undefined,
          axisLabel: {formatter: (value) => (isTime(metric) ? formatAxisTime(value, Math.max(1, most / 10)) : isShare(metric) ? `${Number((100 * value).toPrecision(3))} %` : String(value))},
        },
        series: [
          ...lines.map(({executor, e, values}) => ({
            type: 'line', name: label(executor), symbol: symbols[e % symbols.length], symbolSize: 8, itemStyle: {color: hueOf(t, e).color},
            // Between levels that are not numbers the line has no values and only guides the eye.
            lineStyle: {width: 2, opacity: factor.numeric ? 1 : 0.35, type: executor === 'ideal' || executor === 'unlimited' ? 'dashed' : hueOf(t, e).dash}, data: values,
          })),
          ...lines.map(({executor, e, values}) => ({
            type: 'custom', name: label(executor), silent: true, data: values, encode: {x: 0, y: [2, 3]},
            renderItem: (params, api) => {
              const [left, top] = api.coord([api.value(0), api.value(3)]);
              const bottom = api.coord([api.value(0), api.value(2)])[1];
              if (bottom - top < 1) return null;
              const bar = (x1, y1, x2, y2) => ({type: 'line', shape: {x1, y1, x2, y2}, style: {stroke: hueOf(t, e).color, lineWidth: 1}});
              return {type: 'group', children: [bar(left, top, left, bottom), bar(left - 4, top, left + 4, top), bar(left - 4, bottom, left + 4, bottom)]};
            },
          })),
        ],
      };
    },
  });
}

/** Draws a metric at the chosen levels: a group of bars for each executor, a bar for each of its worlds. */
function worldsFigure() {
  return figure({
    name: 'worlds', height: 340, label: 'A metric of each executor, in each world',
    data: () => spreadTable('world', state.metric, executors.map((executor) => [WORLDS[worldOf.get(executor)], plainName(executor), spreadAt(executor, state.metric)])),
    caption: `Medians at the chosen levels, of ${worlds.length > 1 ? 'the same executor in each world that it ran in' : 'each executor'}. ${intervals}`,
    build(t, width) {
      const {metric} = state;
      const inWorld = (name, world) => executors.find((executor) => plainName(executor) === name && worldOf.get(executor) === world);
      const spread = (name, world) => (inWorld(name, world) ? spreadAt(inWorld(name, world), metric) : null);
      const names = plainNames.filter((name) => worlds.some((world) => spread(name, world) !== null));
      if (names.length === 0) return nothing(metric);
      const all = names.flatMap((name) => worlds.map((world) => spread(name, world))).filter((one) => one !== null);
      const most = Math.max(...all.map((one) => one[0]));
      // Times span several decades and get a logarithmic axis, unless a lateness is negative (early).
      const log = isTime(metric) && all.every((one) => one[0] > 0);
      const floor = log ? 10 ** Math.floor(Math.log10(Math.min(...all.map((one) => one[0])) / 2)) : 0;
      const bars = {barGap: '12%', barMaxWidth: 46};
      return {
        grid: {left: 8, right: 16, top: 60, bottom: 8, containLabel: true},
        legend: worlds.length > 1 ? {} : undefined,
        tooltip: {
          trigger: 'item',
          formatter: ({dataIndex, seriesIndex}) => {
            const one = spread(names[dataIndex], worlds[seriesIndex]);
            return tip([`${names[dataIndex]}, ${WORLDS[worlds[seriesIndex]]}`, show(metric, one[0]),
              one[1] === one[2] ? null : `${show(metric, one[1])} to ${show(metric, one[2])}`]);
          },
        },
        xAxis: {type: 'category', data: names, axisTick: {show: false}, axisLabel: {color: t.ink, interval: 0, rotate: names.length * 62 > width ? 35 : 0}},
        yAxis: {
          type: log ? 'log' : 'value', min: log ? floor : undefined, max: most === 0 ? 1 : undefined, name: METRICS[metric],
          nameTextStyle: {align: 'left'}, nameGap: 14,
          axisLabel: {formatter: (value) => (isTime(metric) ? formatAxisTime(value, log ? value : Math.max(1, Math.abs(most) / 10))
            : isShare(metric) ? `${Number((100 * value).toPrecision(3))} %` : String(value))},
        },
        series: [
          ...worlds.map((world, w) => ({
            type: 'bar', name: WORLDS[world], ...bars, itemStyle: {...fillOf(t, shadeOf(t, w)), borderRadius: [3, 3, 0, 0]},
            data: names.map((name) => { const one = spread(name, world); return one === null ? null : one[0]; }),
            label: {show: names.length * worlds.length * 78 <= width, position: 'top', color: t.soft, fontSize: 11, distance: 6,
              formatter: ({value}) => show(metric, value)},
          })),
          ...worlds.map((world, w) => ({
            type: 'custom', name: WORLDS[world], silent: true, z: 5,
            data: names.map((name, i) => [i, ...(spread(name, world) || [0, 0, 0]).slice(1)]),
            renderItem: (params, api) => {
              if (api.value(1) === api.value(2)) return null;
              const layout = api.barLayout({count: worlds.length, ...bars})[w];
              const [left, top] = api.coord([api.value(0), api.value(2)]);
              const bottom = api.coord([api.value(0), Math.max(api.value(1), log ? floor : api.value(1))])[1];
              const x = left + layout.offsetCenter;
              const line = (x1, y1, x2, y2) => ({type: 'line', shape: {x1, y1, x2, y2}, style: {stroke: t.ink, lineWidth: 1.2}});
              return {type: 'group', children: [line(x, top, x, bottom), line(x - 4, top, x + 4, top), line(x - 4, bottom, x + 4, bottom)]};
            },
          })),
        ],
      };
    },
  });
}

/** Draws a metric for each pair of bounds of two DAGs. */
function boundsFigure() {
  const owners = executors.filter((executor) => knows.get(executor).has('max_active'));
  const note = element('p.soft');
  const self = figure({
    name: 'bounds', height: 380, label: 'A metric for each pair of bounds',
    data: () => spreadTable('max_active', state.metric, pairs.map((pair) => [pair.replace('+', ' and '), label(owners[state.owner]), spreadAt(owners[state.owner], state.metric, {max_active: pair})])),
    caption: 'Horizontal: max_active of the first DAG; vertical: of the second. Numbers are medians; maxima are the largest of all runs.',
    build(t, width) {
      const owner = owners[state.owner];
      const cells = pairs.map((pair) => [...pair.split('+'), spreadAt(owner, state.metric, {max_active: pair})]).filter((cell) => cell[2] !== null);
      if (cells.length === 0) return nothing(state.metric);
      const axis = (i) => [...new Set(cells.map((cell) => cell[i]))].sort((a, b) => a - b);
      const [across, up] = [axis(0), axis(1)];
      const values = cells.map((cell) => cell[2][0]);
      const free = spreadAt(owner, state.metric, {max_active: 'unbounded'});
      const least = Math.min(...values);
      const most = Math.max(...values);
      const part = (value) => (most > least ? (value - least) / (most - least) : 0);
      const mix = (from, to, share) => `rgb(${from.map((c, i) => Math.round(c + (to[i] - c) * share)).join(',')})`;
      const shade = (value) => (t.dark ? mix([30, 40, 50], [150, 172, 192], part(value)) : mix([232, 238, 243], [52, 78, 102], part(value)));
      note.textContent = `${label(owner)}: ${METRICS[state.metric]}${free ? `; without bounds ${show(state.metric, free[0])}` : ''}`;
      return {
        grid: {left: 60, right: 16, top: 28, bottom: 52},
        tooltip: {trigger: 'item', formatter: ({value}) => {
          const [a, b, spread] = cells[value[3]];
          return tip([`max_active ${a} and ${b}`, show(state.metric, spread[0]), `${show(state.metric, spread[1])} to ${show(state.metric, spread[2])}`]);
        }},
        xAxis: {type: 'category', data: across, name: 'max_active of the first DAG', nameLocation: 'middle', nameGap: 28},
        yAxis: {type: 'category', data: up, name: 'max_active of the second DAG', nameLocation: 'middle', nameGap: 32},
        series: [{
          type: 'custom', data: cells.map(([a, b, spread], i) => [across.indexOf(a), up.indexOf(b), spread[0], i]), encode: {x: 0, y: 1},
          renderItem: (params, api) => {
            const [x, y] = api.coord([api.value(0), api.value(1)]);
            const [w, h] = api.size([1, 1]);
            const value = api.value(2);
            return {type: 'group', children: [
              {type: 'rect', shape: {x: x - w / 2 + 1, y: y - h / 2 + 1, width: w - 2, height: h - 2}, style: {fill: shade(value)}},
              {type: 'text', style: {text: show(state.metric, value), x, y, textAlign: 'center', textVerticalAlign: 'middle', fontSize: width < 500 ? 10 : 13,
                fill: (part(value) > 0.5) === t.dark ? '#11151a' : '#ffffff'}},
            ]};
          },
        }],
      };
    },
  });
  return {figure: self, owners, note};
}

/** Returns the share of missed jobs, or of accepted workloads, at each combination. */
function sharesOf(executor, workload) {
  return points.filter(({at}) => at[EXECUTOR] === executor && (workload === undefined || at.workload === workload))
    .map(({dags}) => dags[dags.length - 1]).map((all) => all.missed / Math.max(1, all.released));
}

/** Returns the mean of these shares of each executor but the ideal one, or of each method; the least first. */
function meanMisses() {
  return executors.filter((executor) => plainName(executor) !== 'ideal').map((executor) => {
    const shares = sharesOf(executor);
    return {name: label(executor), mean: shares.reduce((a, b) => a + b, 0) / shares.length, any: shares.length > 0};
  }).filter(({any}) => any).sort((a, b) => a.mean - b.mean);
}

function headlineOf() {
  const bad = report.remarks.find(({good}) => !good);
  if (bad) return {tone: 'bad', text: bad.text};
  const means = meanMisses();
  if (means.length === 0) return {tone: 'caution', text: 'No unit is done'};
  const [best] = means;
  const worst = means[means.length - 1];
  const of = ({name, mean}) => `${name} ${formatPercent(mean)}`;
  if (isRuns && worst.mean === 0) return {tone: 'good', text: 'No deadline was missed'};
  const what = isRuns ? 'Missed deadlines' : 'Accepted workloads';
  return {tone: 'plain', text: `${what}, on average: ${means.length === 1 ? of(best) : `from ${of(best)} to ${of(worst)}`}`};
}

function verdict() {
  const list = report.remarks.map(({good, text}) => ({tone: good ? 'good' : 'bad', text}));
  if (!report.complete) list.push({tone: 'caution', text: `${formatCount(report.done)} of ${formatCount(report.units)} ${report.units_are} are done.`});
  (isRuns ? factors.find(({name}) => name === 'workload').levels : []).forEach((workload) => {
    const parts = executors.map((executor) => {
      const shares = sharesOf(executor, workload);
      if (shares.length === 0) return null;
      const mean = shares.reduce((a, b) => a + b, 0) / shares.length;
      return `${label(executor)} ${formatPercent(mean)}${shares.length > 1 ? ` (${formatPercent(Math.min(...shares))} to ${formatPercent(Math.max(...shares))})` : ''}`;
    }).filter((part) => part !== null);
    list.push({tone: 'plain', text: `${workload}: missed${varied.length > 1 ? ', mean over all combinations' : ''}: ${parts.join('; ')}.`});
  });
  return list;
}

function selectionTable() {
  const factor = varied[state.x];
  const levels = factor === undefined ? [''] : factor.levels;
  const shownMetrics = !isRuns ? report.figures : ['miss_ratio', 'drop_ratio', 'excess_miss_ratio', 'paper_miss_ratio', 'response_p50_ns', 'response_p99_ns', 'max_lateness_ns'];
  const inWorlds = worlds.length > 1 ? [column('world', '', true)] : [];
  const columns = [...(factor ? [column(words(factor.name)), column(EXECUTOR, '', true)] : [column(EXECUTOR)]), ...inWorlds, ...shownMetrics.map((metric) => column(METRICS[metric]))];
  const rows = [];
  levels.forEach((level) => {
    let first = true;
    executors.forEach((executor) => {
      const spread = (metric) => spreadAt(executor, metric, factor ? {[factor.name]: level} : {});
      if (spread(shownMetrics[0]) === null) return;
      const at = factor ? [{text: level, sort: Number.isNaN(Number(level)) ? level : Number(level), kind: first ? '' : 'again'}] : [];
      rows.push({first, cells: [...at, plainName(executor), ...(worlds.length > 1 ? [WORLDS[worldOf.get(executor)]] : []), ...shownMetrics.map((metric) => {
        const value = spread(metric);
        if (value === null) return {text: '\u2013', sort: null};
        const range = `${show(metric, value[1])} to ${show(metric, value[2])}`;
        if (metric !== shownMetrics[0]) return {text: show(metric, value[0]), sort: value[0], title: range};
        // If most runs missed nothing, the median hides the misses of the others.
        const {missed, released} = dagAt(executor, factor ? {[factor.name]: level} : {});
        const counted = `${formatCount(missed)} of ${formatCount(released)}`;
        return {text: value[0] === 0 && missed > 0 ? counted : show(metric, value[0]), sort: value[0], title: `${range}; ${counted} in all ${report.units_are}`, kind: isRuns && missed > 0 ? 'missed' : ''};
      })]});
      first = false;
    });
  });
  return table('Metrics', columns, rows);
}

function howItWasRun() {
  const worldRows = byWorld(executors).map(({world, names}) => (worlds.length > 1 ? [WORLDS[world], `${names.map(plainName).join(', ')} ${DRIVERS[world]}`]
    : ['World', DRIVERS[world]]));
  return [
    heading(2, 'how', `How the ${report.units_are} were made`),
    element('dl', {}, ...[...worldRows, ['Combinations', formatCount(points.length)],
      ...provenanceRows(report.provenance),
    ].flatMap(([name, value]) => [element('dt', {}, name), element('dd', {}, value)])),
    element('details', {}, element('summary', {}, 'The plan'), element('pre', {tabindex: '0'}, report.plan)),
    pageFooter(report),
  ];
}

const intervals = 'Bars: confidence interval of the median over the repetitions (the tables of the experiment state its level); '
  + 'for a maximum, which is that of all runs, from the smallest to the largest run.';
const bars = worlds.length > 1 || varied.length === 0 ? worldsFigure() : null;
const curves = curvesFigure('curves', () => state.metric, `Medians at the chosen levels. ${intervals}`);
const hasIdeal = plainNames.includes('ideal');
const distance = !hasIdeal ? null : curvesFigure('distance', () => 'excess_miss_ratio', 'Missed deadlines above those of the ideal (preemptive, no overhead, no bounds, in virtual '
  + `time) on the same jobs. Values below 0 are better than the ideal; this is possible, because a rate-monotonic order is not optimal. ${intervals}`);
const map = boundsFigure();  // not drawn while hidden, with a width of 0

function redraw() {
  refill();
  [bars, curves, distance, map.figure].forEach((one) => { if (one !== null) one.draw(); });
}
const dagNames = [...new Set(points.flatMap(({dags}) => dags.map(({name}) => name)))].sort((a, b) => (b === 'total') - (a === 'total'));
const levelChoice = ({name, levels}) => dropdown(words(name), levels, levels.indexOf(state.levels[name]),
  (i) => { state.levels[name] = levels[i]; redraw(); });
const controls = filled(() => element('div.row.controls', {},
  varied.length > 1 ? dropdown('over', varied.map(({name}) => words(name)), state.x, (i) => { state.x = i; redraw(); }) : null,
  report.figures.length < 2 ? null : dropdown('of', report.figures.map((metric) => METRICS[metric]), report.figures.indexOf(state.metric), (i) => { state.metric = report.figures[i]; redraw(); }),
  dagNames.length < 2 ? null : dropdown('DAG', dagNames, dagNames.indexOf(state.dag), (i) => { state.dag = dagNames[i]; redraw(); }),
  ...varied.filter((factor, i) => i !== state.x).map(levelChoice)));

startPage([
  element('div.head', {}, element('h1', {}, report.name), element('div.controls', {}, themeChoice())),
  element('p.facts', {}, [plainNames.join(', '), worlds.map((world) => DRIVERS[world]).join(', '), `${formatCount(report.done)} ${report.units_are}`].filter((part) => part !== '').join(' \u00b7 ')),
  headline(headlineOf()), verdictList(verdict()),
  element('details', {}, element('summary', {}, 'Colours and lines'), filled(() => colourKey(EXECUTOR, 'world, or factor'))),
  heading(2, 'curves', varied.length > 0 ? 'Over one factor' : `The ${words(EXECUTOR)}s side by side`), controls,
  ...(varied.length > 0 ? [filled(() => element('p.soft', {}, where([varied[state.x].name]))), curves.box,
    ...(hasIdeal ? [heading(3, 'distance', 'Distance to the ideal'), distance.box] : []), filled(selectionTable)] : []),
  ...(bars === null ? [] : [worlds.length > 1 ? heading(2, 'worlds', 'Comparison of worlds') : null,
    varied.length > 0 ? filled(() => element('div.row.controls', {}, levelChoice(varied[state.x]))) : null,
    varied.length > 0 ? filled(() => element('p.soft', {}, where([]))) : null, bars.box]),
  ...(varied.length > 0 ? [] : [filled(selectionTable)]),
  ...(pairs.length > 0 ? [heading(2, 'bounds', 'Bounds on two DAGs'),
    map.owners.length > 1 ? element('div.row.controls', {}, choice('Executor', map.owners.map(label), 0, (i) => { state.owner = i; map.figure.draw(); })) : null,
    filled(() => element('p.soft', {}, where(['max_active']))), map.note, map.figure.box] : []),
  ...howItWasRun(),
]);
