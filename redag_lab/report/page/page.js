// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The layout of the page of recorded runs, and the reader's choices.

const report = JSON.parse(document.getElementById('data').textContent);
const {groups} = report;
const state = {executor: 0, task: null, tail: false, log: false, view: 0, rows: 'tasks', why: null, longest: false};
const several = groups.length > 1;

/** Returns the sentences of a verdict, without what its headline says. */
const verdictOf = (group) => verdictList(group.verdict.map(({tone, text}) => {
  const said = `${group.headline.text}: `;
  return {tone, text: text.startsWith(said) ? text[said.length].toUpperCase() + text.slice(said.length + 1) : text};
}));

function header() {
  const run = groups[0].run;
  const seconds = (run.end_ns - run.start_ns) / 1e9;
  const runs = groups.reduce((sum, group) => sum + group.runs.length, 0);
  const facts = [
    several ? groups.map((group) => group.label).join(', ') : run.executor,
    `${run.config.workers} worker${run.config.workers === 1 ? '' : 's'}`,
    DRIVERS[run.driver], `${runs > 1 ? `${runs} runs of ` : ''}${Number(seconds.toPrecision(3))} s`,
    `${formatCount(groups.reduce((sum, group) => sum + group.total.released, 0))} jobs`,
  ];
  return [
    element('div.head', {}, element('h1', {}, report.title), element('div.controls', {}, themeChoice())),
    element('p.facts', {}, facts.join(' \u00b7 ')),
    headline(report.headline),
  ];
}

/** Returns the figures of executors side by side: {missed, p99}; null for one executor. */
function comparisonFigures() {
  const rows = report.comparison.dags;
  if (!several || rows.length === 0) return null;
  return {
    missed: comparisonFigure({
      name: 'missed', title: 'missed deadlines', groups, rows, value: (row, cell) => ({...cell.miss_ratio, at: cell.missed / Math.max(1, cell.released)}), log: false,
      format: formatPercent, formatAxis: (share) => `${Number((100 * share).toPrecision(3))} %`,
      caption: 'Share of released jobs that were late, skipped or aborted, over all repetitions. Lines: from the lowest to the highest repetition.',
    }),
    p99: comparisonFigure({
      name: 'p99', title: 'p99 end to end', groups, rows, limit: (cell) => cell.deadline_ns, value: (row, cell) => cell.p99_ns && {...cell.p99_ns, at: cell.p99_ns.median}, log: true,
      format: (ns) => (ns > 0 ? formatTime(Number(ns.toPrecision(3))) : ''), formatAxis: (ns) => formatAxisTime(ns, ns),
      caption: '99th percentile of the end-to-end response time (logarithmic): median over the repetitions. Lines: from the lowest to the highest repetition. '
        + 'Dashed: the end-to-end deadline, where the workload states one.',
    }),
  };
}

function comparisonSection(figures, ranks) {
  if (!several) return [];
  const parts = [heading(2, 'comparison', 'Executors side by side')];
  if (figures === null) return [...parts, element('p', {}, 'The runs have no DAG in common.')];
  return [...parts, filled(() => comparisonTable(groups, report.comparison.dags)), verdictList(ranks), figures.p99.box];
}

function taskChoice(refresh) {
  return filled(() => {
    const group = groups[state.executor];
    const tasks = group.tasks.map((task, i) => i).filter((i) => hasCurve(group.tasks[i]));
    const names = ['all tasks, relative to their deadlines', ...tasks.map((i) => taskName(group, i))];
    return dropdown('task', names, 1 + tasks.indexOf(state.task), (i) => {
      state.task = i === 0 ? null : tasks[i - 1];
      refill();
      refresh();
    });
  });
}

function detailSections() {
  const responses = responseFigure(groups, state);
  const lateness = latenessFigure(groups, state);
  const timeline = timelineFigure(groups, state);
  const why = whySection(groups, state);
  const schedule = scheduleFigure(groups, state, why.show);
  const redraw = () => { responses.draw(); lateness.draw(); };

  const executors = choice('Executor', groups.map((group) => group.label), 0, (i) => {
    const name = state.task === null ? null : taskName(groups[state.executor], state.task);
    state.executor = i;
    // Keeps the chosen task if the other executor has it.
    const same = name === null ? -1 : groups[i].tasks.findIndex((task, k) => taskName(groups[i], k) === name);
    state.task = same < 0 ? null : same;
    state.view = 0;
    refill();
    redraw();
    timeline.draw();
    schedule.look();
    why.refill();
  });
  const pick = several ? [element('div.row.executors', {}, element('span.soft', {}, 'Details of'), executors)] : [];
  // Shows the worst miss of an executor in the schedule.
  const look = (g) => {
    executors.children[g].click();
    document.getElementById('detail').scrollIntoView();
  };

  const nodes = [
    ...pick,
    several ? filled(() => [element(`p.headline.${groups[state.executor].headline.tone}`, {}, ...headlineParts(groups[state.executor].headline)), verdictOf(groups[state.executor])]) : null,
    heading(2, 'dags', 'DAGs'), filled(() => dagTable(groups[state.executor])),
    heading(2, 'tasks', 'Tasks: measured times and bounds'),
    filled(() => {
      const {bounds, tasks} = groups[state.executor];
      const order = tasks.length > MOST_ROWS_AT_ONCE ? ' The tasks closest to a miss come first.' : '';
      return element('p.soft', {}, `${bounds.absent ? `No bounds: ${bounds.absent}.`
        : `Bounds for ${bounds.assumes}. The tooltip of a bound names its method.`}${order}`);
    }),
    filled(() => taskTable(groups[state.executor])),
    heading(3, 'parts', 'Where response times go'),
    element('div.row.controls', {}, choice('Jobs', ['all jobs, mean', 'longest response'], 0, (i) => { state.longest = i === 1; refill(); })),
    element('p.soft', {}, 'From the release to the finish. The parts sum to the response time. Orange: time that other jobs cost it.'),
    filled(() => splitTable(groups[state.executor], state.longest)),
    heading(2, 'responses', 'Response times'),
    element('div.row.controls', {}, taskChoice(redraw),
      choice('Curve', ['distribution', 'tail'], 0, (i) => { state.tail = i === 1; responses.draw(); }),
      choice('Time axis', ['linear time', 'logarithmic'], 0, (i) => { state.log = i === 1; responses.draw(); })),
    responses.box,
    heading(3, 'lateness', 'Lateness'), lateness.box,
    ...why.nodes,
    heading(2, 'schedule', 'Schedule'),
    filled(() => {
      const run = nameOfWorstRun(groups[state.executor]);
      return run ? [element('p.soft', {}, `Of ${run}.`)] : [];
    }),
    timeline.box,
    heading(3, 'detail', 'Schedule in detail'),
    element('div.row.controls', {},
      filled(() => dropdown('show', viewNames(groups[state.executor]), state.view, (i) => { state.view = i; schedule.look(); })),
      choice('Rows', ['tasks', groups.some(({devices}) => devices.length > 0) ? 'workers and devices' : 'workers'], 0, (i) => { state.rows = i === 1 ? 'workers' : 'tasks'; schedule.draw(); })),
    filled(() => element('p.keys.soft', {}, ...groups[state.executor].dags.slice(0, 24).map((dag, d) => element('span', {}, swatch(hueOf(theme(), d)), dag.name)))),
    schedule.box,
  ];
  return {nodes, look};
}

/** Returns the notes on what is not shown. A note common to several executors appears once. */
function cuts() {
  const owners = new Map();
  report.cuts.forEach((cut) => {
    const at = several ? cut.indexOf(': ') : -1;
    const what = cut.slice(at < 0 ? 0 : at + 2);
    owners.set(what, [...(owners.get(what) || []), ...(at < 0 ? [] : [cut.slice(0, at)])]);
  });
  return [...owners].map(([what, names]) => (names.length === 0 ? what : `${names.join(', ')}: ${what}`));
}

function howItWasRun() {
  const facts = () => {
    const {run, runs} = groups[state.executor];
    const {config, machine} = run;
    const rows = [
      ['Executor', run.executor], ['World', DRIVERS[run.driver]],
      ['Preemption', run.preemption + (run.preemption_why ? ` (${run.preemption_why})` : '')],
      ['Workers', `${config.workers}${config.levels ? `, ${config.levels} priority levels` : ''}`], ['Policy', config.policy],
      ['Length', `${formatTime(run.end_ns - run.start_ns)}${run.warm_up_ns ? `, without jobs of the first ${formatTime(run.warm_up_ns)} (warm-up)` : ''}`],
      ['Overheads', run.overheads || 'none'],
      ['Machine', [machine.model, machine.cpus ? `${machine.cpus} processors` : '', machine.kernel].filter(Boolean).join(', ') || 'not recorded'],
    ];
    rows.push(...provenanceRows(runs[0].provenance));
    if (run.lost_events > 0) rows.push(['Lost events', formatCount(run.lost_events)]);
    return [element('dl', {}, ...rows.flatMap(([name, value]) => [element('dt', {}, name), element('dd', {}, value)])),
      element('details', {}, element('summary', {}, 'The workload'), element('pre', {tabindex: '0'}, run.workload))];
  };
  return [
    heading(2, 'how', 'How the runs were made'), filled(facts), runTable(groups),
    ...(report.cuts.length === 0 ? [] : [heading(3, 'cuts', 'What is not shown'), element('ul.soft', {}, ...cuts().map((cut) => element('li', {}, cut)))]),
    pageFooter(report),
  ];
}

const figures = comparisonFigures();
const details = detailSections();
const [notes, ranks] = [true, false].map((isNote) => report.comparison.words.filter(({tone}) => (tone === 'caution') === isNote));
const worst = filled(() => worstMisses(groups, details.look) || []);
startPage([...header(), figures === null ? worst : element('div.first', {}, figures.missed.box, worst), several ? verdictList(notes) : verdictOf(groups[0]),
  element('details', {}, element('summary', {}, 'Colours and lines'), filled(() => colourKey('DAG', 'executor'))), ...comparisonSection(figures, ranks), ...details.nodes, ...howItWasRun()]);
