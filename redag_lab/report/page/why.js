// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explains misses: the causes of the run, the worst jobs, and where the time of one job went. A job is chosen in the
// list, or by a click on it in the schedule. The program chose and explained them; nothing is judged here.

const MOST_LISTED_AT_ONCE = 12;

function causesTable({causes}) {
  const columns = [
    column('cause'), column('jobs', 'Jobs that it delayed'), column('mainly', 'Jobs that it delayed more than any other cause'),
    column('time', 'Its time in all these jobs'),
  ];
  return element('div.why', {}, table('Causes', columns, causes.map((cause) => ({cells: [cause.text, countCell(cause.jobs), countCell(cause.main), timeCell(cause.time_ns)]}))));
}

function partsTable(job) {
  const {begin_ns: begins, length_ns: lengths, text, work} = job.parts;
  const columns = [column(job.end_to_end ? 'since its data began' : 'since its release'), column('nanoseconds'), column('share'), column('what happened', '', 'text')];
  const rows = lengths.map((length, i) => ({cells: [timeCell(begins[i]), countCell(length), {text: formatPercent(length / Math.max(1, job.length_ns)), sort: length},
    {text: text[i], kind: work[i] ? '' : 'delay'}]}));
  return element('div.why', {}, table('Parts of the job', columns, rows, {most: Infinity}));
}

/** Returns which run was looked into: "", or "repetition-2, the worst of 3 runs". */
function nameOfWorstRun({runs, worst_run: worst}) {
  return runs.length === 1 ? '' : `${runs[worst].path.split('/').pop()}, the worst of ${runs.length} runs`;
}

/**
 * Returns the worst miss of each group, with its cause and what to change. `look(g)` is called for the one that the
 * reader wants to see. Null without a miss.
 */
function worstMisses(groups, look) {
  if (groups.every(({why}) => why.misses === 0)) return null;
  const parts = groups.map((group, g) => {
    const name = groups.length > 1 ? element('h3', {}, named(shadeOf(theme(), g), group.label)) : null;
    if (group.why.misses === 0) return element('div', {}, name, element('p.met', {}, 'No deadline missed.'));
    const {text, since_ns: since, cause, cause_ns: length, remedy} = group.why.jobs[0];
    const run = nameOfWorstRun(group);
    return element('div', {}, name, element('p', {}, element('button.link.missed', {type: 'button', onclick: () => look(g)}, text),
      element('span.soft', {}, ` ${formatTime(since)} after the start${run ? ` of ${run}` : ''}`)),
    element('p', {}, element('b', {}, 'Cause: '), cause ? `${cause} for ${formatTime(length)}` : 'lost at its release'),
    remedy ? element('p', {}, element('b', {}, 'What to change: '), remedy) : null);
  });
  return element('section.worst', {}, heading(2, 'worst-miss', groups.length > 1 ? 'The worst miss of each executor' : 'The worst miss'), ...parts);
}

/** Returns the section and a function that shows a job in it: show(task, number, missed). */
function whySection(groups, state) {
  const why = () => groups[state.executor].why;
  const nameOf = ({task, number}) => `${taskName(groups[state.executor], task)}#${number}`;
  const command = (name) => `redag why ${groups[state.executor].runs[0].path} ${name}`;
  const chosen = () => state.why || why().jobs[0];  // at first the worst one
  const isChosen = ({task, number}) => chosen().task === task && chosen().number === number;

  const intro = place(() => {
    const {misses, explained} = why();
    const run = nameOfWorstRun(groups[state.executor]) || 'this run';
    const words = misses === 0 ? `No deadline was missed. These are the jobs of ${run} that came closest, and what took their time.`
      : `${formatCount(misses)} job${misses === 1 ? '' : 's'} missed a deadline in ${run}. ${misses > explained ? `The causes cover the worst ${formatCount(explained)}. ` : ''}`
        + 'A job chosen in the list, or clicked on in the schedule, is explained below the list.';
    return [element('p.soft', {}, words), why().causes.length === 0 ? '' : causesTable(why())];
  });
  const list = place(() => {
    const {jobs, misses} = why();
    const columns = [column('job'), column('late by', 'After its deadline; negative: time to spare'), column('outcome', '', 'text'), column('released', 'Since the start of the run'),
      column('main cause', '', 'text')];
    const rows = jobs.map((job) => ({current: isChosen(job), cells: [
      {text: element('button.link', {type: 'button', onclick: () => show(job.task, job.number, job.missed)}, ...breakable(nameOf(job))), sort: nameOf(job)},
      timeCell(job.lateness_ns, {kind: lateKind(job.missed)}), [OUTCOMES[job.outcome], REASONS[job.reason]].filter(Boolean).join(': '), timeCell(job.since_ns),
      job.cause || 'lost at its release']}));
    return [element('div.why', {}, table('The worst jobs', columns, rows, {most: MOST_LISTED_AT_ONCE, total: misses})),
      misses > rows.length ? element('p.soft', {}, `All of them: ${command('--all')}`) : ''];
  });
  const panel = place(() => {
    if (!chosen()) return [];
    const job = why().jobs.find(isChosen);
    if (job) return [element(job.missed ? 'p.job.missed' : 'p.job', {}, job.text), partsTable(job)];
    const name = nameOf(chosen());
    return [element('p.soft', {}, `${name} ${chosen().missed ? 'missed its deadline' : 'met its deadline'} and is not among the jobs explained here: ${command(name)}`)];
  });
  panel.setAttribute('aria-live', 'polite');

  function show(task, number, missed) {
    state.why = {task, number, missed};
    const hadFocus = list.contains(document.activeElement);
    list.refill();
    if (hadFocus) list.querySelector('tr[aria-current] button').focus();
    panel.refill();
    panel.scrollIntoView({block: 'nearest'});
  }
  const refillAll = () => [intro, list, panel].forEach((node) => node.refill());
  themed.push(refillAll);
  refillAll();
  return {
    nodes: [heading(2, 'why', 'Why were jobs late?'), intro, heading(3, 'worst', 'The worst jobs'), list, panel],
    refill() {
      state.why = null;
      refillAll();
    },
    show,
  };
}
