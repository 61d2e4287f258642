// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the page of `redag serve` shows of a frame: bars of workers, devices, histograms, the course of the response
// times, and the rows of DAGs and tasks. What is equal from frame to frame stays, with focus and scrolling.

const NEAR = 0.9;        // share of a limit that counts as near, as in redag top
const COURSE_S = 120;    // how far back the chart goes

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

const DEVICE_COLUMNS = [column('device'), column('busy', 'Time of its services, as a share of its slots', 'text'), column('slots', 'Slots in use, and there are'),
  column('queue', 'Jobs that wait for a slot'), column('served/s', 'Services that ended, per second', 'minor'), column('serves', 'The tasks of the jobs that it serves now', 'text')];
const deviceRows = ({devices}) => devices.map(({name, busy, used, slots, queued, rate, tasks}) => ({cells: [
  name, {text: loadBar(busy), sort: busy}, {text: `${used}/${slots}`, sort: used}, countCell(queued), perSecond(rate),
  [...tasks, ...(used > tasks.length ? [`${used - tasks.length} more`] : [])].join(', ')]}));

/** Returns a histogram with a logarithmic axis of time from `low` to `high`, which all rows share. */
function histogram(classes, {low, high}, deadline) {
  const [width, height] = [132, 22];
  const at = (ns) => width * Math.log(Math.max(ns, low) / low) / Math.log(high / low);
  const most = Math.max(1, ...classes.map(([, count]) => count));
  const bars = classes.map(([ns, count]) => {
    const tall = Math.max(2, height * count / most);
    return svgElement('rect', {x: at(ns).toFixed(1), y: (height - tall).toFixed(1), width: Math.max(2, at(Math.max(ns, low) * 1.42) - at(ns) - 0.5).toFixed(1), height: tall.toFixed(1),
      class: deadline && ns >= deadline ? 'late' : 'in-time'});
  });
  if (deadline && deadline > low && deadline < high) bars.push(svgElement('line', {x1: at(deadline).toFixed(1), x2: at(deadline).toFixed(1), y1: 0, y2: height}));
  const jobs = classes.reduce((sum, [, count]) => sum + count, 0);
  return svgElement('svg', {class: 'spread', viewBox: `0 0 ${width} ${height}`, preserveAspectRatio: 'none', role: 'img', 'aria-label': `${formatCount(jobs)} response times`}, ...bars);
}

const LIVE_COLUMNS = [
  column('DAG and task'), column('rate/s', 'Jobs that finished, per second', 'minor'), column('p50', 'Median response time; of a DAG end to end', 'minor'),
  column('p99', '99th percentile of the response time'), column('max', 'Longest response time', 'minor'),
  column('deadline', 'Relative deadline; of a DAG end to end', 'minor'), column('bound', 'Proven bound on the response time, where one is known', 'minor'),
  column('missed', 'Jobs late, skipped or aborted since the start'), column('lately', 'Jobs late, skipped or aborted in the last seconds', 'minor'),
  column('active', 'Jobs that have started and not ended, and the bound on them', 'minor'),
  column('away', 'Active jobs that wait without a worker: for a device, an event, a time, or in a call that blocks', 'minor'),
  column('ready', 'Released jobs that could start', 'minor'), column('wait', 'Released jobs that wait for predecessors', 'minor'),
  column('cpu', 'Share of one processor, of the jobs that ended', 'minor'),
  column('times', 'How often each response time occurred, on one logarithmic axis for all rows; dashed: the deadline', 'text'),
];

/** Returns the rows of the DAGs, each with its tasks. `view` has rows, filter and whole. */
function liveRows({dags, tasks}, view) {
  const all = dags.flatMap((dag) => [{...dag, full: dag.name, isDag: true}, ...tasks.filter((task) => task.dag === dag.name).map((task) => ({...task, full: `${task.dag}.${task.name}`}))]);
  const least = all.flatMap((row) => row.histogram.all.map(([ns]) => ns));
  const low = Math.max(1000, Math.min(...least));
  const range = {low, high: 1.5 * Math.max(low, ...least)};
  const timeOf = (ns, row) => ({...timeCell(ns > 0 ? ns : null), kind: toneOf(ns, row)});
  return all.filter((row) => row.full.toLowerCase().includes(view.filter.toLowerCase()) && (view.rows === 'all' || (view.rows === 'DAGs') === Boolean(row.isDag))).map((row) => {
    const {p50_ns: p50, p99_ns: p99, max_ns: max} = view.whole ? row.response : row.recent.response;
    const {misses: lately} = row.recent;
    const isFull = row.max_active > 0 && row.active >= row.max_active;
    return {first: row.isDag, cells: [
      {text: row.full, kind: [row.isDag ? '' : 'again', lately > 0 ? 'missed' : ''].filter(Boolean).join('.')}, perSecond(row.rate), ...[p50, p99, max].map((ns) => timeOf(ns, row)),
      timeCell(row.deadline_ns), timeCell(row.bound_ns), countCell(row.misses, {kind: lately > 0 ? 'missed' : row.misses > 0 ? 'delay' : ''}), countCell(lately, {kind: lately > 0 ? 'missed' : ''}),
      {text: row.max_active > 0 ? `${row.active}/${row.max_active}` : String(row.active), sort: row.active, kind: isFull ? 'delay' : ''},
      countCell(row.away), countCell(row.ready), countCell(row.waiting), {text: formatPercent(row.cpu), sort: row.cpu},
      {text: least.length > 0 ? histogram(view.whole ? row.histogram.all : row.histogram.recent, range, row.deadline_ns) : '', sort: p99, title: `from ${formatTime(Number(low.toPrecision(2)))} to ${formatTime(Number(range.high.toPrecision(2)))}`}]};
  });
}

/** Remembers the p99 of each DAG and draws it over the last minutes. */
function courseFigure() {
  const lines = new Map();  // name -> [[s, ns], ...]
  let now = 0;
  let drawn = -1;  // when the chart was drawn last; once a second is enough
  const build = (t) => {
    if (lines.size === 0) return 'No response time yet.';
    const least = Math.min(...[...lines.values()].flat().map(([, ns]) => ns));
    return {
      grid: {left: 62, right: 12, top: 34, bottom: 34},
      legend: {},
      tooltip: {trigger: 'axis', formatter: (items) => tip([`${Math.round(-items[0].value[0])} s ago`, ...items.map((item) => `${item.seriesName}: ${formatTime(item.value[1])}`)])},
      xAxis: {type: 'value', min: -COURSE_S, max: 0, axisLabel: {formatter: (s) => (s === 0 ? 'now' : `\u2212${-s} s`)}, splitLine: {show: false}},
      yAxis: {type: 'log', min: least / 1.5, axisLabel: {formatter: (ns) => formatTime(Number(ns.toPrecision(2)))}},
      series: [...lines].map(([name, data], i) => ({name, type: 'line', data: data.map(([s, ns]) => [s - now, ns]), showSymbol: data.length < 3, lineStyle: {width: 1.8}, color: hueOf(t, i).color})),
    };
  };
  const fig = figure({name: 'course', height: 300, build, label: 'p99 of the response time over the last two minutes',
    caption: 'Recent p99 (logarithmic) of the DAGs, end to end. Of many, the eight with the longest one.'});
  return {
    box: fig.box,
    clear: () => lines.clear(),
    update(frame) {
      now = frame.up_ns / 1e9;
      for (const {name, recent} of frame.dags) {
        const line = lines.get(name) ?? [];
        if (recent.response.p99_ns > 0 && (line.at(-1)?.[0] ?? -1) < now) line.push([now, recent.response.p99_ns]);
        while (line.length > 0 && line[0][0] < now - COURSE_S) line.shift();
        if (line.length > 0) lines.set(name, line);
        else lines.delete(name);
      }
      const longest = [...lines].sort(([, a], [, b]) => b.at(-1)[1] - a.at(-1)[1]).slice(8);
      longest.forEach(([name]) => lines.delete(name));
      if (now - drawn < 1 && now >= drawn) return;
      drawn = now;
      if (fig.chart() === null) fig.draw();
      else fig.chart().setOption(withTheme(build(theme()), theme(), fig.box.clientWidth), {replaceMerge: ['series']});
    },
  };
}
