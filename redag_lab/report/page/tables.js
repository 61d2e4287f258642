// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws the tables: by DAG, by task, executors side by side, and the runs.

const MOST_ROWS_AT_ONCE = 40;

const column = (title, help, text = false) => ({title, help, text});
const swatch = (t, index) => element('span.swatch', {style: `background:${colourOf(t, index)}`});

function missCell(jobs) {
  const lost = Object.entries(jobs.lost_by_reason).map(([reason, count]) => `${formatCount(count)} ${reason}`);
  return {
    text: formatCountAndShare(jobs.missed, jobs.released), kind: jobs.missed > 0 ? 'bad' : 'good',
    title: `${formatCount(jobs.missed)} of ${formatCount(jobs.released)}: ${[`${formatCount(jobs.late)} late`, ...lost].join(', ')}`,
  };
}

/** Returns a bar from the median to the maximum on a track that ends at the deadline, with the bound as a tick. */
function meter(t, response, deadline, bound, colour) {
  if (!response || !deadline) return '';
  const most = Math.max(deadline, response.max_ns, bound || 0) * 1.04;
  const x = (ns) => (100 * ns / most).toFixed(2);
  const late = response.max_ns > deadline;
  const title = `p50 ${formatTime(response.p50_ns)}, p99 ${formatTime(response.p99_ns)}, max ${formatTime(response.max_ns)}; `
    + `deadline ${formatTime(deadline)}${bound ? `, bound ${formatTime(bound)}` : ''}`;
  const svg = svgElement('svg', {class: 'meter', viewBox: '0 0 100 16', preserveAspectRatio: 'none', role: 'img', 'aria-label': title},
    svgElement('rect', {x: 0, y: 5, width: x(deadline), height: 6, fill: t.line}),
    svgElement('rect', {x: 0, y: 5, width: x(response.max_ns), height: 6, fill: late ? t.bad : colour, opacity: 0.45}),
    svgElement('rect', {x: 0, y: 5, width: x(response.p99_ns), height: 6, fill: late && response.p99_ns > deadline ? t.bad : colour, opacity: 0.6}),
    svgElement('rect', {x: 0, y: 5, width: x(response.p50_ns), height: 6, fill: colour}),
    svgElement('rect', {x: Math.max(0, x(deadline) - 0.5), y: 1, width: 0.9, height: 14, fill: t.bad}));
  if (bound) svg.append(svgElement('rect', {x: Math.max(0, x(bound) - 0.5), y: 1, width: 0.9, height: 14, fill: t.good}));
  return element('span', {title}, svg);
}

const meterHelp = 'Solid: median; lighter: p99 and max; grey: time up to the deadline. Red tick: deadline; green tick: bound';

function boundCell(bound, measured, method, alarm) {
  if (bound === null || bound === undefined) return '\u2013';
  return {text: formatTime(bound), kind: alarm ? 'bad' : '', title: `by ${method}${measured > bound ? '; the bound was exceeded' : ''}`};
}

function taskTable(group, unfolded, unfold) {
  const t = theme();
  const columns = [
    column('task'), column('period'), column('deadline'), column('jobs', 'Released jobs'), column('missed', 'Late, skipped or aborted jobs, of all released jobs'),
    column('p50', 'Median response time: finish \u2212 release'), column('p99'), column('max'), column('bound', 'Tightest sound bound on the response time'),
    column('measured, bound, deadline', meterHelp, true), column('max lateness', 'Largest finish \u2212 deadline; negative: the least time to spare'),
    column('executed / wcet', 'Largest processor time of a job, and the stated worst-case execution time'), column('preempted', 'Number of preemptions'),
  ];
  // Of many tasks, only those closest to a miss are shown at first.
  const all = group.tasks.filter((task) => task.jobs !== undefined);
  const closeness = ({jobs, deadline_ns: deadline}) => [jobs.miss_ratio, jobs.max_lateness_ns === null ? -1 : jobs.max_lateness_ns / deadline];
  const few = [...all].sort((a, b) => closeness(b)[0] - closeness(a)[0] || closeness(b)[1] - closeness(a)[1]).slice(0, MOST_ROWS_AT_ONCE);
  const shown = unfolded || all.length <= MOST_ROWS_AT_ONCE ? all : few;
  let dag = -1;
  const rows = shown.map((task) => {
    const first = task.dag !== dag;
    dag = task.dag;
    const r = task.jobs.response;
    const name = `${group.dags[task.dag].name}.${task.name}`;
    return {first, cells: [
      {text: element('span', {title: name}, swatch(t, task.dag), name)}, formatTime(task.period_ns), formatTime(task.deadline_ns), formatCount(task.jobs.released),
      missCell(task.jobs), formatTime(r && r.p50_ns), formatTime(r && r.p99_ns),
      {text: formatTime(r && r.max_ns), kind: r && r.max_ns > task.deadline_ns ? 'bad' : ''},
      boundCell(task.bound_ns, r ? r.max_ns : 0, task.method, task.bound_alarm),
      {text: meter(t, r, task.deadline_ns, task.bound_ns, colourOf(t, task.dag))},
      {text: formatTime(task.jobs.max_lateness_ns), kind: task.jobs.max_lateness_ns > 0 ? 'bad' : ''},
      {text: `${formatTime(task.execution_max_ns)} / ${task.wcet_ns > 0 ? formatTime(task.wcet_ns) : '\u2013'}`,
        kind: task.wcet_exceeded ? 'bad' : ''},
      formatCount(task.jobs.preemptions),
    ]};
  });
  if (shown.length === all.length) return [table(columns, rows)];
  return [table(columns, rows), element('p.row.soft', {}, `The ${shown.length} tasks closest to a miss, of ${all.length}.`,
    element('button.controls', {type: 'button', onclick: unfold}, `show all ${all.length} tasks`))];
}

/** Returns the responses of each sink of a DAG with several sinks. */
function sinkTimes(group, dag) {
  const {sinks} = dag.end_to_end;
  if (sinks.length < 2) return undefined;
  return sinks.map(({task, response}) => `${group.tasks[task].name}: p50 ${formatTime(response && response.p50_ns)}, `
    + `p99 ${formatTime(response && response.p99_ns)}, max ${formatTime(response && response.max_ns)}`).join('\n');
}

function dagTable(group) {
  const t = theme();
  const columns = [
    column('DAG'), column('tasks'), column('rate', 'Rate of its fastest task'), column('jobs'), column('missed', 'Late, skipped or aborted jobs, of all released jobs'),
    column('end to end p50', 'From a source\u2019s release to a sink\u2019s finish; with several sinks, each figure is that of the worst one'), column('p99'), column('max'),
    column('bound'), column('deadline', 'End-to-end deadline'), column('late', 'Jobs of sinks that finished after the end-to-end deadline'),
    column('active / bound', 'Most jobs in progress at any time, and max_active'),
  ];
  return table(columns, group.dags.map((dag, d) => {
    const r = dag.end_to_end.response;
    return {cells: [
      {text: element('span', {}, swatch(t, d), dag.cluster ? `${dag.name} (${dag.cluster})` : dag.name)}, String(dag.tasks), dag.period_ns > 0 ? `${Number((1e9 / dag.period_ns).toPrecision(3))} Hz` : '\u2013',
      formatCount(dag.jobs.released), missCell(dag.jobs), formatTime(r && r.p50_ns), formatTime(r && r.p99_ns), {text: formatTime(r && r.max_ns), title: sinkTimes(group, dag)},
      boundCell(dag.bound_ns, r ? r.max_ns : 0, dag.method, dag.bound_alarm),
      dag.deadline_ns > 0 ? formatTime(dag.deadline_ns) : '\u2013',
      dag.deadline_ns > 0 ? {text: formatCount(dag.end_to_end.late), kind: dag.end_to_end.late > 0 ? 'bad' : 'good'} : '\u2013',
      `${dag.peak_active} / ${dag.max_active > 0 ? dag.max_active : '\u221e'}`,
    ]};
  }));
}

function comparisonTable(groups, rows) {
  const t = theme();
  const help = 'End to end, from a source\u2019s release to a sink\u2019s finish; with several sinks, that of the worst one. ';
  const several = groups.some((group) => group.runs.length > 1);
  const median = several ? 'Median of the repetitions' : '';
  const columns = [
    column('DAG'), column('executor', '', true), column('jobs'), column('late', 'Jobs that finished after their deadline, or are overdue'),
    column('missed', 'Late, skipped or aborted jobs, of all released jobs'),
    ...['p50', 'p95', 'p99'].map((name) => column(several ? `${name}, median` : name, `${help}${median}`)),
    column(several ? 'max of all' : 'max', `${help}${several ? 'The largest of all repetitions' : ''}`),
  ];
  const range = ({min, max}) => (formatPercent(min) === formatPercent(max) ? undefined : `repetitions: ${formatPercent(min)} to ${formatPercent(max)}`);
  return table(columns, rows.flatMap((row) => row.groups.map((cell, g) => ({first: g === 0, cells: [
    g === 0 ? row.name : '', {text: element('span', {}, swatch(t, g), groups[g].label)}, formatCount(cell.released), formatCount(cell.late),
    {text: formatCountAndShare(cell.missed, cell.released), kind: cell.missed > 0 ? 'bad' : 'good', title: range(cell.miss_ratio)},
    ...['p50_ns', 'p95_ns', 'p99_ns'].map((key) => formatTime(cell[key] && cell[key].median)),
    {text: formatTime(cell.max_ns), kind: cell.end_to_end_late > 0 ? 'bad' : ''},
  ]}))));
}

function runTable(groups) {
  const columns = [
    column('run'), column('recorded', 'UTC', true), column('seed'), column('jobs'), column('missed'), column('workers busy'), column('rules checked'), column('violations'),
    column('priority inversions', 'Intervals in which a more urgent job waited while a less urgent one ran'), column('longest'),
  ];
  return table(columns, groups.flatMap((group) => group.runs.map((run) => ({cells: [
    {text: element('span', {title: run.path}, run.path.split('/').slice(-2).join('/'))},
    {text: run.provenance ? run.provenance.created : '\u2013', title: run.provenance ? Object.entries(run.provenance).map(([key, value]) => `${key}: ${value}`).join('\n') : undefined},
    String(run.seed), formatCount(run.released), {text: formatCountAndShare(run.missed, run.released), kind: run.missed > 0 ? 'bad' : 'good'},
    run.worker_busy.map((share) => `${(100 * share).toFixed(0)}\u00a0%`).join(', '), formatCount(run.checks),
    {text: formatCount(run.violation_count), kind: run.violation_count > 0 ? 'bad' : 'good', title: run.violations.join('\n')},
    formatCount(run.inversions.count), formatTime(run.inversions.longest_ns),
  ]}))));
}
