// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws the tables: by DAG, by task, and executors side by side.

/** Returns a distribution, or null if it is of nothing. */
const known = (response) => (response.count > 0 ? response : null);

function missCell(jobs) {
  const lost = Object.entries(jobs.lost_by_reason).map(([reason, count]) => `${formatCount(count)} ${REASONS[reason]}`);
  return shareCell(jobs.missed, jobs.released, {
    kind: jobs.missed > 0 ? 'missed' : 'met',
    title: `${formatCount(jobs.missed)} of ${formatCount(jobs.released)}: ${[`${formatCount(jobs.late)} late`, ...lost].join(', ')}`,
  });
}

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
    column('max lateness', 'Largest finish \u2212 deadline; negative: the least time to spare'),
    column('executed / wcet', 'Largest processor time of a job, and the stated worst-case execution time'), column('preempted', 'Number of preemptions'),
  ];
  // Of many tasks, those closest to a miss come first.
  const closeness = ({jobs, deadline_ns: deadline}) => 1e6 * jobs.miss_ratio_with_lost + (jobs.max_lateness_ns ?? -deadline) / deadline;
  const tasks = group.tasks.filter((task) => task.jobs !== undefined);
  if (tasks.length > MOST_ROWS_AT_ONCE) tasks.sort((a, b) => closeness(b) - closeness(a));
  let dag = -1;
  const rows = tasks.map((task) => {
    const first = task.dag !== dag;
    dag = task.dag;
    const r = known(task.jobs.response);
    const look = hueOf(t, task.dag);
    return {first, cells: [
      {text: named(look, `${group.dags[task.dag].name}.${task.name}`)}, timeCell(task.period_ns), timeCell(task.deadline_ns), countCell(task.jobs.released),
      missCell(task.jobs), ...percentileCells(r, 'p50', 'p99'), timeCell(r && r.max_ns, {kind: lateKind(r && r.max_ns > task.deadline_ns)}),
      boundCell(task.bound_ns, r ? r.max_ns : 0, task.method, task.bound_alarm),
      timeCell(task.jobs.max_lateness_ns, {kind: lateKind(task.jobs.max_lateness_ns > 0)}),
      {text: `${formatTime(task.execution_max_ns)} / ${formatTime(task.wcet_ns > 0 ? task.wcet_ns : null)}`, sort: task.execution_max_ns,
        kind: lateKind(task.wcet_exceeded)},
      countCell(task.jobs.preemptions),
    ]};
  });
  return table('Tasks', columns, rows);
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
    const r = known(dag.end_to_end.response);
    const rate = dag.period_ns > 0 ? 1e9 / dag.period_ns : null;
    return {cells: [
      {text: named(hueOf(t, d), dag.cluster ? `${dag.name} (${dag.cluster})` : dag.name)}, countCell(dag.tasks),
      {text: rate === null ? '\u2013' : `${Number(rate.toPrecision(3))} Hz`, sort: rate},
      countCell(dag.jobs.released), missCell(dag.jobs), ...percentileCells(r, 'p50', 'p99', 'max'),
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
    column('DAG'), column('executor', '', 'text'), column('jobs'), column('late', 'Jobs that finished after their deadline, or are overdue'),
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
