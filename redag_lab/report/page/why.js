// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explains misses: the causes of the run, and where the time of one job went. A job is chosen in the list, or by a
// click on it in the schedule.

function causesTable({causes}) {
  const columns = [
    column('cause'), column('jobs', 'Jobs that it delayed'), column('mainly', 'Jobs that it delayed more than any other cause'),
    column('time', 'Its time in all these jobs'),
  ];
  return element('div.why', {}, table(columns, causes.map((cause) => ({cells: [{text: cause.text, title: cause.text}, formatCount(cause.jobs), formatCount(cause.main), formatTime(cause.time_ns)]}))));
}

/** Returns a bar of a job's parts, as long as they took. */
function partsBar(job) {
  const t = theme();
  const {length_ns: lengths, text, work} = job.parts;
  let at = 0;
  const parts = lengths.map((length, i) => {
    const x = 100 * at / Math.max(1, job.length_ns);
    at += length;
    const width = 100 * length / Math.max(1, job.length_ns);
    return svgElement('rect', {x: x.toFixed(3), y: 0, width: width.toFixed(3), height: 16, fill: work[i] ? t.soft : t.caution,
      opacity: work[i] || i % 2 === 0 ? 1 : 0.6}, svgElement('title', {}, `${text[i]}: ${formatTime(length)}`));
  });
  return svgElement('svg', {class: 'parts', viewBox: '0 0 100 16', preserveAspectRatio: 'none', role: 'img',
    'aria-label': `Parts of ${formatTime(job.length_ns)}`}, ...parts);
}

function partsTable(job) {
  const {begin_ns: begins, length_ns: lengths, text, work} = job.parts;
  const columns = [column(job.end_to_end ? 'since its data began' : 'since its release'), column('nanoseconds'), column('share'), column('what happened', '', true)];
  const share = (length) => formatPercent(length / Math.max(1, job.length_ns));
  const rows = lengths.map((length, i) => ({cells: [begins[i] === null ? '' : formatTime(begins[i]), formatCount(length), share(length),
    {text: text[i], kind: work[i] ? '' : 'delay'}]}));
  rows.push({first: true, cells: ['', formatCount(job.length_ns), share(job.length_ns), 'in all']});
  return element('div.why', {}, table(columns, rows));
}

/** Returns the section and a function that shows a job in it: show(task, number). */
function whySection(groups, state) {
  const why = () => groups[state.executor].why;
  const chosen = () => why().jobs[Math.min(state.why, why().jobs.length - 1)];
  const panel = place(() => {
    if (state.unexplained) return [element('p.soft', {}, state.unexplained)];
    const job = chosen();
    if (!job) return [];
    return [element(job.missed ? 'p.job.bad' : 'p.job', {}, job.text), partsBar(job), partsTable(job)];
  });
  const choose = (i) => {
    state.why = i;
    state.unexplained = null;
    panel.refill();
  };
  const list = place(() => dropdown('job', why().jobs.map(({text}) => text), state.why, choose));
  const intro = place(() => {
    const {misses, explained} = why();
    const words = misses === 0 ? 'No deadline was missed in this run. These are the jobs that came closest, and what took their time.'
      : `${formatCount(misses)} job${misses === 1 ? '' : 's'} missed a deadline in this run. ${misses > explained ? `The causes cover the worst ${formatCount(explained)}. ` : ''}`
        + 'A click on a job in the schedule below explains it here.';
    return [element('p.soft', {}, words)];
  });
  const causes = place(() => (why().causes.length === 0 ? [] : [causesTable(why())]));
  const all = [intro, causes, list, panel];
  const refillAll = () => {
    state.why = 0;
    state.unexplained = null;
    all.forEach((node) => node.refill());
  };
  themed.push(() => panel.refill());
  refillAll();
  return {
    nodes: [element('h2', {id: 'why'}, 'Why were jobs late?'), intro, causes, element('div.row.controls', {}, list), panel],
    refill: refillAll,
    show(task, number, missed) {
      const name = `${taskName(groups[state.executor], task)}#${number}`;
      const i = why().jobs.findIndex((job) => job.task === task && job.number === number);
      if (i >= 0) state.why = i;
      const path = groups[state.executor].runs[0].path;
      state.unexplained = i >= 0 ? null
        : `${name} ${missed ? 'missed its deadline' : 'met its deadline'} and is not among the jobs explained here: redag why ${path} ${name}`;
      list.refill();
      panel.refill();
      panel.scrollIntoView({block: 'nearest'});
    },
  };
}
