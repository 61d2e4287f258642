// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the page of `redag serve` shows of a frame: bars of workers, and the rows of DAGs and tasks. What is equal from
// frame to frame stays, with focus and scrolling.

const NEAR = 0.9;  // share of a limit that counts as near, as in redag top

/** Rates a response time: beyond the deadline or the bound, near the lesser of them, or neither. */
function toneOf(ns, {deadline_ns: deadline = null, bound_ns: bound = null}) {
  const limit = Math.min(deadline ?? Infinity, bound ?? Infinity);
  if (ns > limit) return 'missed';
  return ns >= NEAR * limit ? 'delay' : '';
}

/** Returns a bar of a share, and its number. */
function loadBar(share) {
  const kind = share >= 0.9 ? 'div.bar.full' : share >= 0.7 ? 'div.bar.busy' : 'div.bar';
  return element('div.load', {}, element(kind, {}, element('div', {style: `width:${(100 * Math.min(1, share)).toFixed(1)}%`})), element('span', {}, formatPercent(share)));
}

/** Returns the bars of the workers. */
const workerBars = ({threads}) => threads.filter(({cpu, task}) => cpu > 0 || task !== null).sort((a, b) => a.index - b.index)
  .map(({index, cpu, task}) => element('div.worker', {}, element('span.soft', {}, String(index)), loadBar(cpu), element('span.task', {}, task ?? '')));

const perSecond = (rate) => ({text: rate > 0 ? String(Number(rate.toPrecision(4))) : '\u2013', sort: rate});

/** "gpu 80.4 % busy, 2 queued", of all devices. */
const devicesInWords = ({devices}) => devices.map(({name, busy, queued}) => `${name} ${formatPercent(busy)} busy, ${formatCount(queued)} queued`).join(' \u00b7 ');

const LIVE_COLUMNS = [
  column('DAG and task'), column('rate/s', 'Jobs that finished, per second', 'minor'), column('p50', 'Median response time; of a DAG end to end', 'minor'),
  column('p99', '99th percentile of the response time'), column('max', 'Longest response time', 'minor'),
  column('deadline', 'Relative deadline; of a DAG end to end', 'minor'), column('bound', 'Proven bound on the response time, where one is known', 'minor'),
  column('missed', 'Jobs late, skipped or aborted since the start'), column('lately', 'Jobs late, skipped or aborted in the last seconds', 'minor'),
  column('active', 'Jobs that have started and not ended, and the bound on them', 'minor'),
  column('away', 'Active jobs that wait without a worker: for a device, an event, a time, or in a call that blocks', 'minor'),
  column('ready', 'Released jobs that could start', 'minor'), column('wait', 'Released jobs that wait for predecessors', 'minor'),
  column('cpu', 'Share of one processor, of the jobs that ended', 'minor'),
];

/** Returns the rows of the DAGs, each with its tasks. `view` has rows, filter and whole. */
function liveRows({dags, tasks}, view) {
  const all = dags.flatMap((dag) => [{...dag, full: dag.name, isDag: true}, ...tasks.filter((task) => task.dag === dag.name).map((task) => ({...task, full: `${task.dag}.${task.name}`}))]);
  const timeOf = (ns, row) => ({...timeCell(ns > 0 ? ns : null), kind: toneOf(ns, row)});
  return all.filter((row) => row.full.toLowerCase().includes(view.filter.toLowerCase()) && (view.rows === 'all' || (view.rows === 'DAGs') === Boolean(row.isDag))).map((row) => {
    const {p50_ns: p50, p99_ns: p99, max_ns: max} = view.whole ? row.response : row.recent.response;
    const {misses: lately} = row.recent;
    const isFull = row.max_active > 0 && row.active >= row.max_active;
    return {first: row.isDag, cells: [
      {text: row.full, kind: [row.isDag ? '' : 'again', lately > 0 ? 'missed' : ''].filter(Boolean).join('.')}, perSecond(row.rate), ...[p50, p99, max].map((ns) => timeOf(ns, row)),
      timeCell(row.deadline_ns), timeCell(row.bound_ns), countCell(row.misses, {kind: lately > 0 ? 'missed' : row.misses > 0 ? 'delay' : ''}), countCell(lately, {kind: lately > 0 ? 'missed' : ''}),
      {text: row.max_active > 0 ? `${row.active}/${row.max_active}` : String(row.active), sort: row.active, kind: isFull ? 'delay' : ''},
      countCell(row.away), countCell(row.ready), countCell(row.waiting), {text: formatPercent(row.cpu), sort: row.cpu}]};
  });
}
