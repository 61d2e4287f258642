// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The page of an experiment: executors, or methods of the analysis, over any factor at chosen levels of the others.

const report = JSON.parse(document.getElementById('data').textContent);
const {factors} = report;
// Each level of the last factor has a line: executors, or methods.
const EXECUTOR = factors.at(-1).name;
const isRuns = EXECUTOR === 'executor';
// The rows of each combination, one for each DAG; the last one is of all DAGs together.
const points = [];
report.rows.forEach(({at, labels, counts: [released, missed], values}) => {
  const [world, , dag] = isRuns ? labels : [undefined, '', 'total'];
  const key = JSON.stringify(at);
  if (points.at(-1)?.key !== key) points.push({key, at, world, dags: []});
  points.at(-1).dags.push({name: dag, released, missed, values});
});
// The world of each executor. One experiment can have runs of several worlds, as executors "mte", "threads/mte",
// "ros2/mte".
const worldOf = new Map(factors.at(-1).levels.map((executor) => [executor, points.find(({at}) => at[EXECUTOR] === executor)?.world]));
const worlds = Object.keys(WORLDS).filter((world) => [...worldOf.values()].includes(world));
const plainName = (executor) => executor.slice(executor.indexOf('/') + 1);
const label = (executor) => (worlds.length > 1 ? `${plainName(executor)}, ${WORLDS[worldOf.get(executor)]}` : executor);
// Sorts executors so that the worlds of one executor are side by side.
const plainNames = [...new Set([...worldOf.keys()].map(plainName))];
const executors = [...worldOf.keys()].sort((a, b) => plainNames.indexOf(plainName(a)) - plainNames.indexOf(plainName(b))
  || worlds.indexOf(worldOf.get(a)) - worlds.indexOf(worldOf.get(b)));
const varied = factors.filter(({name, levels}) => name !== EXECUTOR && levels.length > 1);

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

// The reader's choice: a level of each factor, the factor along the axis, a metric, and a DAG.
const state = {x: Math.max(0, varied.findIndex(({name}) => (isRuns ? name !== 'workload' : name === 'utilization'))), metric: report.figures[0], dag: 'total', levels: {}};
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

// Formats a value on an axis whose largest one is `most`.
const showOnAxis = (metric, value, most) => (isTime(metric) ? formatAxisTime(value, Math.max(1, Math.abs(most) / 10))
  : isShare(metric) ? `${Number((100 * value).toPrecision(3))} %` : String(value));

/** Draws a metric over the chosen factor, with a line for each executor. */
function curvesFigure() {
  return figure({
    name: 'curves', height: 348, label: 'A metric over a factor, by executor', caption: `Medians at the chosen levels. ${intervals}`,
    build(t, width) {
      const factor = varied[state.x];
      const {metric} = state;
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
          axisLabel: {formatter: (value) => showOnAxis(metric, value, most)},
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
  return comparisonFigure({
    name: 'worlds', label: 'A metric of each executor, in each world',
    caption: `Medians at the chosen levels, of ${worlds.length > 1 ? 'the same executor in each world that it ran in' : 'each executor'}. ${intervals}`,
    data() {
      const {metric} = state;
      const spread = (name, world) => {
        const executor = executors.find((one) => plainName(one) === name && worldOf.get(one) === world);
        const [at, min, max] = (executor && spreadAt(executor, metric)) || [null, null, null];
        return {at, min, max};
      };
      const names = plainNames.filter((name) => worlds.some((world) => spread(name, world).at !== null));
      const series = worlds.map((world) => ({name: WORLDS[world], values: names.map((name) => spread(name, world))}));
      const values = series.flatMap((one) => one.values.map(({at}) => at)).filter((at) => at !== null);
      // Times span several decades and get a logarithmic axis, unless a lateness is negative (early).
      const log = isTime(metric) && values.every((at) => at > 0);
      const most = Math.max(...values);
      return {names, series, log, title: METRICS[metric], none: nothing(metric), format: (value) => show(metric, value),
        formatAxis: (value) => showOnAxis(metric, value, log ? 10 * value : most)};
    },
  });
}

/**
 * Returns the shares of missed jobs, or of accepted workloads, over all combinations (of a workload) as {name, mean,
 * least, most, count}, for each executor or method that has any.
 */
function sharesOf(workload) {
  return executors.map((executor) => {
    const shares = points.filter(({at}) => at[EXECUTOR] === executor && (workload === undefined || at.workload === workload))
      .map(({dags}) => dags[dags.length - 1]).map(({missed, released}) => missed / Math.max(1, released));
    return {name: label(executor), isIdeal: plainName(executor) === 'ideal', mean: shares.reduce((a, b) => a + b, 0) / shares.length,
      least: Math.min(...shares), most: Math.max(...shares), count: shares.length};
  }).filter(({count}) => count > 0);
}

function headlineOf() {
  const bad = report.remarks.find(({good}) => !good);
  if (bad) return {tone: 'bad', text: bad.text};
  const all = sharesOf().filter(({isIdeal}) => !isIdeal).sort((a, b) => a.mean - b.mean);
  if (all.length === 0) return {tone: 'caution', text: 'No unit is done'};
  const [best, worst] = [all[0], all[all.length - 1]];
  const of = ({name, mean}) => `${name} ${formatPercent(mean)}`;
  if (isRuns && worst.mean === 0) return {tone: 'good', text: 'No deadline was missed'};
  const what = isRuns ? 'Missed deadlines' : 'Accepted workloads';
  return {tone: 'plain', text: `${what}, on average: ${all.length === 1 ? of(best) : `from ${of(best)} to ${of(worst)}`}`};
}

function verdict() {
  const list = report.remarks.map(({good, text}) => ({tone: good ? 'good' : 'bad', text}));
  if (!report.complete) list.push({tone: 'caution', text: `${formatCount(report.done)} of ${formatCount(report.units)} ${report.units_are} are done.`});
  (isRuns ? factors.find(({name}) => name === 'workload').levels : []).forEach((workload) => {
    const parts = sharesOf(workload).map(({name, mean, least, most, count}) => `${name} ${formatPercent(mean)}${count > 1 ? ` (${formatPercent(least)} to ${formatPercent(most)})` : ''}`);
    list.push({tone: 'plain', text: `${workload}: missed${varied.length > 1 ? ', mean over all combinations' : ''}: ${parts.join('; ')}.`});
  });
  return list;
}

function selectionTable() {
  const factor = varied[state.x];
  const levels = factor === undefined ? [''] : factor.levels;
  const shownMetrics = !isRuns ? report.figures : ['miss_ratio', 'drop_ratio', 'excess_miss_ratio', 'paper_miss_ratio', 'response_p50_ns', 'response_p99_ns', 'max_lateness_ns'];
  const inWorlds = worlds.length > 1 ? [column('world', '', 'text')] : [];
  const columns = [...(factor ? [column(words(factor.name)), column(EXECUTOR, '', 'text')] : [column(EXECUTOR)]), ...inWorlds, ...shownMetrics.map((metric) => column(METRICS[metric]))];
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
  const worldRows = worlds.map((world) => (worlds.length > 1
    ? [WORLDS[world], `${executors.filter((executor) => worldOf.get(executor) === world).map(plainName).join(', ')} ${DRIVERS[world]}`] : ['World', DRIVERS[world]]));
  return [
    heading(2, 'how', `How the ${report.units_are} were made`),
    factList([...worldRows, ['Combinations', formatCount(points.length)], ...provenanceRows(report.provenance)]),
    element('details', {}, element('summary', {}, 'The plan'), element('pre', {tabindex: '0'}, report.plan)),
    pageFooter(report),
  ];
}

const intervals = 'Bars: confidence interval of the median over the repetitions (the tables of the experiment state its level); '
  + 'for a maximum, which is that of all runs, from the smallest to the largest run.';
const bars = worlds.length > 1 || varied.length === 0 ? worldsFigure() : null;
const curves = varied.length > 0 ? curvesFigure() : null;

function redraw() {
  refill();
  charts.forEach((chart) => chart.draw());
}
const dagNames = [...new Set(points.flatMap(({dags}) => dags.map(({name}) => name)))].sort((a, b) => (b === 'total') - (a === 'total'));
const levelChoice = ({name, levels}) => dropdown(words(name), levels, levels.indexOf(state.levels[name]),
  (i) => { state.levels[name] = levels[i]; redraw(); });
const controls = filled(() => element('div.row.controls', {},
  varied.length > 1 ? dropdown('over', varied.map(({name}) => words(name)), state.x, (i) => { state.x = i; redraw(); }) : null,
  report.figures.length < 2 ? null : dropdown('of', report.figures.map((metric) => METRICS[metric]), report.figures.indexOf(state.metric), (i) => { state.metric = report.figures[i]; redraw(); }),
  dagNames.length < 2 ? null : dropdown('DAG', dagNames, dagNames.indexOf(state.dag), (i) => { state.dag = dagNames[i]; redraw(); }),
  ...varied.filter((factor, i) => i !== state.x).map(levelChoice)));

startPage(report.name, [
  element('div.head', {}, element('h1', {}, report.name), element('div.controls', {}, themeChoice())),
  element('p.facts', {}, [plainNames.join(', '), worlds.map((world) => DRIVERS[world]).join(', '), `${formatCount(report.done)} ${report.units_are}`].filter((part) => part !== '').join(' \u00b7 ')),
  headline(headlineOf()), verdictList(verdict()),
  heading(2, 'curves', varied.length > 0 ? 'Over one factor' : `The ${words(EXECUTOR)}s side by side`), controls,
  ...(varied.length > 0 ? [curves.box, filled(selectionTable)] : []),
  ...(bars === null ? [] : [worlds.length > 1 ? heading(2, 'worlds', 'Comparison of worlds') : null,
    varied.length > 0 ? filled(() => element('div.row.controls', {}, levelChoice(varied[state.x]))) : null,
    bars.box]),
  ...(varied.length > 0 ? [] : [filled(selectionTable)]),
  ...howItWasRun(),
]);
