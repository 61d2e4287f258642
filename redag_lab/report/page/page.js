// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The layout of the page of recorded runs, and the reader's choices.

const report = JSON.parse(document.getElementById('data').textContent);
const {groups} = report;
const state = {executor: 0, view: 0, why: null};
const several = groups.length > 1;
const isComparable = report.comparison.dags.length > 0;

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

const missedFigure = () => comparisonFigure({
  name: 'missed', label: 'missed deadlines',
  caption: 'Share of released jobs that were late, skipped or aborted, over all repetitions. Lines: from the lowest to the highest repetition.',
  data: () => ({
    title: 'missed deadlines', none: 'No job finished.', names: report.comparison.dags.map((dag) => dag.name), log: false, format: formatPercent,
    formatAxis: (share) => `${Number((100 * share).toPrecision(3))} %`,
    series: groups.map((group, g) => ({name: group.label, values: report.comparison.dags.map((dag) => {
      const {miss_ratio: {min, max}, missed, released} = dag.groups[g];
      return {at: missed / Math.max(1, released), min, max};
    })})),
  }),
});

function comparisonSection() {
  if (!several) return [];
  const title = heading(2, 'comparison', 'Executors side by side');
  if (!isComparable) return [title, element('p', {}, 'The runs have no DAG in common.')];
  return [title, filled(() => comparisonTable(groups, report.comparison.dags))];
}

function detailSections() {
  const why = whySection(groups, state);
  const schedule = scheduleFigure(groups, state, why.show);

  const executors = choice('Executor', groups.map((group) => group.label), 0, (i) => {
    state.executor = i;
    state.view = 0;
    refill();
    schedule.look();
    why.refill();
  });
  const pick = several ? [element('div.row.executors', {}, element('span.soft', {}, 'Details of'), executors)] : [];
  // Shows the worst miss of an executor in the schedule.
  const look = (g) => {
    executors.children[g].click();
    document.getElementById('schedule').scrollIntoView();
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
    ...why.nodes,
    heading(2, 'schedule', 'Schedule'),
    filled(() => {
      const run = nameOfWorstRun(groups[state.executor]);
      return run ? [element('p.soft', {}, `Of ${run}.`)] : [];
    }),
    element('div.row.controls', {},
      filled(() => dropdown('show', viewNames(groups[state.executor]), state.view, (i) => { state.view = i; schedule.look(); }))),
    filled(() => element('p.keys.soft', {}, ...groups[state.executor].dags.slice(0, 24).map((dag, d) => element('span', {}, swatch(hueOf(theme(), d)), dag.name)))),
    schedule.box,
  ];
  return {nodes, look};
}

function howItWasRun() {
  const facts = () => {
    const {run, runs, worst_run: worst} = groups[state.executor];
    const {config, machine} = run;
    const rows = [
      ['Executor', run.executor], ['World', DRIVERS[run.driver]],
      ['Preemption', run.preemption + (run.preemption_why ? ` (${run.preemption_why})` : '')],
      ['Workers', `${config.workers}${config.levels ? `, ${config.levels} priority levels` : ''}`], ['Policy', config.policy],
      ['Length', `${formatTime(run.end_ns - run.start_ns)}${run.warm_up_ns ? `, without jobs of the first ${formatTime(run.warm_up_ns)} (warm-up)` : ''}`],
      ['Workers busy', runs[worst].worker_busy.map((share) => formatPercent(share)).join(', ')], ['Overheads', run.overheads || 'none'],
      ['Machine', [machine.model, machine.cpus ? `${machine.cpus} processors` : '', machine.kernel].filter(Boolean).join(', ') || 'not recorded'],
    ];
    rows.push([runs.length > 1 ? 'Folders' : 'Folder', runs.map(({path}) => path).join(', ')], ...provenanceRows(runs[0].provenance));
    if (run.lost_events > 0) rows.push(['Lost events', formatCount(run.lost_events)]);
    return [factList(rows), element('details', {}, element('summary', {}, 'The workload'), element('pre', {tabindex: '0'}, run.workload))];
  };
  return [
    heading(2, 'how', 'How the runs were made'), filled(facts),
    ...(report.cuts.length === 0 ? [] : [heading(3, 'cuts', 'What is not shown'), element('ul.soft', {}, ...report.cuts.map((cut) => element('li', {}, cut)))]),
    pageFooter(report),
  ];
}

const details = detailSections();
const worst = filled(() => worstMisses(groups, details.look) || []);
startPage(report.title, [...header(), isComparable ? element('div.first', {}, missedFigure().box, worst) : worst,
  verdictList(report.notes.map((text) => ({tone: 'caution', text}))), several ? null : verdictOf(groups[0]),
  ...comparisonSection(), ...details.nodes, ...howItWasRun()]);
