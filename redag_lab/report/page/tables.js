// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws the tables: by DAG, by task, executors side by side, and the runs.

function missCell(jobs) {
  const lost = Object.entries(jobs.lost_by_reason).map(([reason, count]) => `${formatCount(count)} ${REASONS[reason]}`);
  return shareCell(jobs.missed, jobs.released, {
    kind: jobs.missed > 0 ? 'missed' : 'met',
    title: `${formatCount(jobs.missed)} of ${formatCount(jobs.released)}: ${[`${formatCount(jobs.late)} late`, ...lost].join(', ')}`,
  });
}

/** Returns a bar from the median to the maximum on a track that ends at the deadline, with the bound as a tick. */
function meter(t, response, deadline, bound, colour) {
  if (!response || !deadline) return '';
  const most = Math.max(deadline, response.max_ns, bound || 0) * 1.04;
  const x = (ns) => (100 * ns / most).toFixed(2);
  const title = `p50 ${formatTime(response.p50_ns)}, p99 ${formatTime(response.p99_ns)}, max ${formatTime(response.max_ns)}; `
    + `deadline ${formatTime(deadline)}${bound ? `, bound ${formatTime(bound)}` : ''}`;
  const bar = (ns, opacity) => svgElement('rect', {x: 0, y: 5, width: x(ns), height: 6, fill: ns > deadline ? t.missed : colour, opacity});
  const tick = (ns, y, height) => svgElement('rect', {x: Math.max(0, x(ns) - 0.5), y, width: 1.2, height, fill: t.ink});
  const svg = svgElement('svg', {class: 'meter', viewBox: '0 0 100 16', preserveAspectRatio: 'none', role: 'img', 'aria-label': title},
    svgElement('rect', {x: 0, y: 5, width: x(deadline), height: 6, fill: t.line}),
    bar(response.max_ns, 0.45), bar(response.p99_ns, 0.6), bar(response.p50_ns, 1), tick(deadline, 0, 16));
  if (bound) svg.append(tick(bound, 0, 3), tick(bound, 13, 3));
  return element('span', {title}, svg);
}

const meterHelp = 'Solid: median; lighter: p99 and max; grey: time up to the deadline. Whole tick: deadline; ticks above and below: bound';

function boundCell(bound, measured, method, alarm) {
  if (bound === null || bound === undefined) return {text: '\u2013', sort: null};
  return timeCell(bound, {kind: alarm ? 'missed' : '', title: `by ${method}${measured > bound ? '; the bound was exceeded' : ''}`});
}

const percentileCells = (response, ...names) => names.map((name) => timeCell(response && response[`${name}_ns`]));
const lateKind = (isLate) => (isLate ? 'missed' : '');

function taskTable(group) {
  const t = theme();
  const columns = [
    column('task'), column('period'), column('deadline'), column('jobs', 'Released jobs'), column('missed', 'Late, skipped or aborted jobs, of all released jobs'),
    column('p50', 'Median response time: finish \u2212 release'), column('p99'), column('max'), column('bound', 'Tightest sound bound on the response time'),
    column('meter', meterHelp, true), column('max lateness', 'Largest finish \u2212 deadline; negative: the least time to spare'),
    column('executed / wcet', 'Largest processor time of a job, and the stated worst-case execution time'), column('preempted', 'Number of preemptions'),
  ];
  // Of many tasks, those closest to a miss come first.
  const closeness = ({jobs, deadline_ns: deadline}) => [jobs.miss_ratio, jobs.max_lateness_ns === null ? -1 : jobs.max_lateness_ns / deadline];
  const tasks = group.tasks.filter((task) => task.jobs !== undefined);
  if (tasks.length > MOST_ROWS_AT_ONCE) tasks.sort((a, b) => closeness(b)[0] - closeness(a)[0] || closeness(b)[1] - closeness(a)[1]);
  let dag = -1;
  const rows = tasks.map((task) => {
    const first = task.dag !== dag;
    dag = task.dag;
    const r = task.jobs.response;
    const name = `${group.dags[task.dag].name}.${task.name}`;
    const look = hueOf(t, task.dag);
    return {first, cells: [
      {text: named(look, name)}, timeCell(task.period_ns), timeCell(task.deadline_ns), countCell(task.jobs.released),
      missCell(task.jobs), ...percentileCells(r, 'p50', 'p99'), timeCell(r && r.max_ns, {kind: lateKind(r && r.max_ns > task.deadline_ns)}),
      boundCell(task.bound_ns, r ? r.max_ns : 0, task.method, task.bound_alarm),
      {text: meter(t, r, task.deadline_ns, task.bound_ns, look.color), sort: r ? r.max_ns / task.deadline_ns : null},
      timeCell(task.jobs.max_lateness_ns, {kind: lateKind(task.jobs.max_lateness_ns > 0)}),
      {text: `${formatTime(task.execution_max_ns)} / ${formatTime(task.wcet_ns > 0 ? task.wcet_ns : null)}`, sort: task.execution_max_ns,
        kind: lateKind(task.wcet_exceeded)},
      countCell(task.jobs.preemptions),
    ]};
  });
  return table('Tasks', columns, rows);
}

const STAY_HELP = {
  not_ready: 'Its release was not seen yet, or a predecessor was incomplete',
  ready: 'Could start or go on, but for a worker; before it has started also for max_active, its group, or an earlier job of its task',
  on_worker: 'Had a worker',
  preempted: 'Lost its worker to another job',
  device_queue: 'Had asked a device, which served others',
  device: 'Was served by a device',
  waits: 'Waited without a worker for something else: an event, a time, or in a call that blocks',
};

/** Returns a bar of the parts of a response, by stay. Work has the hue of the DAG; orange is time that others cost it. */
function splitBar(t, lengths, colour) {
  const looks = {not_ready: [t.line, 1], ready: [t.delay, 1], on_worker: [colour, 1], preempted: [t.delay, 0.7], device_queue: [t.delay, 0.45],
    device: [colour, 0.55], waits: [t.soft, 0.5]};
  const sum = Math.max(1, lengths.reduce((a, b) => a + b, 0));
  let at = 0;
  const parts = Object.keys(STAYS).map((stay, i) => {
    const x = 100 * at / sum;
    at += lengths[i];
    const [fill, opacity] = looks[stay];
    return svgElement('rect', {x: x.toFixed(3), y: 2, width: (100 * lengths[i] / sum).toFixed(3), height: 12, fill, opacity},
      svgElement('title', {}, `${STAYS[stay]}: ${formatPercent(lengths[i] / sum)}`));
  });
  return svgElement('svg', {class: 'meter split', viewBox: '0 0 100 16', preserveAspectRatio: 'none', role: 'img', 'aria-label': 'The parts beside it as shares'}, ...parts);
}

/** Returns where the response times of each task go: of all its jobs, or of the one with the longest response. */
function splitTable(group, longest) {
  const t = theme();
  const tasks = group.tasks.filter((task) => task.jobs !== undefined && task.jobs.response);
  const lengthsOf = ({jobs}) => (longest ? jobs.split.longest_ns : jobs.split.total_ns.map((ns) => ns / jobs.response.count));
  const stays = Object.keys(STAYS).map((stay, i) => ({stay, i})).filter(({i}) => tasks.some(({jobs}) => jobs.split.total_ns[i] > 0));
  const columns = [column('task'), column(longest ? 'longest response' : 'mean response'), column('parts', 'The columns behind it, as shares', true),
    ...stays.map(({stay}) => column(STAYS[stay], STAY_HELP[stay]))];
  const delays = ['ready', 'preempted', 'device_queue'];
  let dag = -1;
  return table('Parts of response times', columns, tasks.map((task) => {
    const first = task.dag !== dag;
    dag = task.dag;
    const look = hueOf(t, task.dag);
    const lengths = lengthsOf(task);
    const sum = lengths.reduce((a, b) => a + b, 0);
    return {first, cells: [{text: named(look, `${group.dags[task.dag].name}.${task.name}`)}, timeCell(sum), {text: splitBar(t, lengths, look.color), sort: sum},
      ...stays.map(({stay, i}) => timeCell(lengths[i], {kind: lengths[i] > 0 && delays.includes(stay) ? 'delay' : '', title: formatPercent(lengths[i] / Math.max(1, sum))}))]};
  }));
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
    column('DAG'), column('tasks'), column('rate', 'Rate of its fastest task'), column('jobs'), column('missed', 'Jobs of its tasks that were late for their own deadlines, skipped or aborted, of all released jobs'),
    column('end to end p50', 'From a source\u2019s release to a sink\u2019s finish; with several sinks, each figure is that of the worst one'), column('p99'), column('max'),
    column('bound', 'Tightest sound bound on the response end to end'), column('deadline', 'End-to-end deadline'), column('late end to end', 'Jobs of sinks that finished after the end-to-end deadline of the DAG'),
    column('most active / max_active', 'Most jobs in progress at any time, and the limit on them'),
  ];
  return table('DAGs', columns, group.dags.map((dag, d) => {
    const r = dag.end_to_end.response;
    const rate = dag.period_ns > 0 ? 1e9 / dag.period_ns : null;
    return {cells: [
      {text: named(hueOf(t, d), dag.cluster ? `${dag.name} (${dag.cluster})` : dag.name)}, countCell(dag.tasks),
      {text: rate === null ? '\u2013' : `${Number(rate.toPrecision(3))} Hz`, sort: rate},
      countCell(dag.jobs.released), missCell(dag.jobs), ...percentileCells(r, 'p50', 'p99'), timeCell(r && r.max_ns, {title: sinkTimes(group, dag)}),
      boundCell(dag.bound_ns, r ? r.max_ns : 0, dag.method, dag.bound_alarm),
      timeCell(dag.deadline_ns > 0 ? dag.deadline_ns : null),
      dag.deadline_ns > 0 ? countCell(dag.end_to_end.late, {kind: dag.end_to_end.late > 0 ? 'missed' : 'met'}) : {text: '\u2013', sort: null},
      {text: `${dag.peak_active} / ${dag.max_active > 0 ? dag.max_active : '\u221e'}`, sort: dag.peak_active},
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
    column(several ? 'max of all' : 'max', `${help}${several ? 'The largest of all repetitions' : ''}`), column('deadline', 'Of the response end to end'),
  ];
  const range = ({min, max}) => (formatPercent(min) === formatPercent(max) ? undefined : `repetitions: ${formatPercent(min)} to ${formatPercent(max)}`);
  return table('Executors', columns, rows.flatMap((row) => row.groups.map((cell, g) => ({first: g === 0, cells: [
    {text: row.name, kind: g === 0 ? '' : 'again'}, {text: named(shadeOf(t, g), groups[g].label)}, countCell(cell.released), countCell(cell.late),
    shareCell(cell.missed, cell.released, {kind: cell.missed > 0 ? 'missed' : 'met', title: range(cell.miss_ratio)}),
    ...['p50_ns', 'p95_ns', 'p99_ns'].map((key) => timeCell(cell[key] && cell[key].median)),
    timeCell(cell.max_ns, {kind: lateKind(cell.end_to_end_late > 0)}), timeCell(cell.deadline_ns),
  ]}))));
}

function runTable(groups) {
  const columns = [
    column('run'), column('recorded', 'UTC', true), column('seed'), column('jobs'), column('missed'), column('workers busy'), column('rules checked'), column('violations'),
    column('priority inversions', 'Intervals in which a more urgent job waited while a less urgent one ran'), column('longest'),
  ];
  return table('Runs', columns, groups.flatMap((group) => group.runs.map((run) => ({cells: [
    {text: element('span', {title: run.path}, ...breakable(run.path.split('/').slice(-2).join('/')))},
    {text: run.provenance ? run.provenance.created : '\u2013', title: run.provenance ? Object.entries(run.provenance).map(([key, value]) => `${key}: ${value}`).join('\n') : undefined},
    {text: String(run.seed), sort: run.seed}, countCell(run.released), shareCell(run.missed, run.released, {kind: run.missed > 0 ? 'missed' : 'met'}),
    run.worker_busy.map((share) => `${(100 * share).toFixed(0)}\u00a0%`).join(', '), countCell(run.checks),
    countCell(run.violation_count, {kind: run.violation_count > 0 ? 'missed' : 'met', title: run.violations.join('\n')}),
    countCell(run.inversions.count), timeCell(run.inversions.longest_ns),
  ]}))));
}
