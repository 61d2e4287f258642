// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the page of `redag serve` shows of a frame: bars of workers, devices, histograms, the course of the response
// times, and the table of DAGs and tasks. Elements are kept from frame to frame, so that focus and scrolling stay.

const NEAR = 0.9;        // share of a limit that counts as near, as in redag top
const MOST_ROWS = 500;   // a browser is slow with more
const COURSE_S = 120;    // how far back the chart goes

/** Sets the text of a node if it changes. */
function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
function setClass(node, name) {
  if (node.getAttribute('class') !== name) node.setAttribute('class', name);
}

/** Rates a response time: beyond the deadline or the bound, near the lesser of them, or neither. */
function toneOf(ns, {deadline_ns: deadline = null, bound_ns: bound = null}) {
  const limit = Math.min(deadline ?? Infinity, bound ?? Infinity);
  if (ns > limit) return 'bad-text';
  return ns >= NEAR * limit ? 'near-text' : '';
}

/** Returns the bars of the workers as {node, update(frame)}. */
function workerBars() {
  const node = element('div.workers');
  const rows = new Map();
  const make = (index) => {
    const fill = element('div');
    const parts = {bar: element('div.bar', {}, fill), fill, share: element('span.share'), task: element('span.task')};
    return {...parts, node: element('div.worker', {}, element('span.soft', {}, String(index)), parts.bar, parts.share, parts.task)};
  };
  return {
    node,
    update({threads}) {
      const shown = threads.filter((thread) => thread.cpu > 0 || thread.task !== null);
      const kept = new Set(shown.map((thread) => thread.index));
      for (const [index, row] of rows) {
        if (kept.has(index)) continue;
        row.node.remove();
        rows.delete(index);
      }
      for (const {index, cpu, task} of shown) {
        if (!rows.has(index)) rows.set(index, make(index));
        const row = rows.get(index);
        row.fill.style.width = `${(100 * Math.min(1, cpu)).toFixed(1)}%`;
        setClass(row.bar, cpu >= 0.9 ? 'bar full' : cpu >= 0.7 ? 'bar busy' : 'bar');
        setText(row.share, formatPercent(cpu));
        setText(row.task, task ?? '');
      }
      const order = [...rows.keys()].sort((a, b) => a - b).map((index) => rows.get(index).node);
      if (order.some((bar, i) => node.children[i] !== bar)) node.append(...order);
    },
  };
}

/** Returns the table of the devices as {node, update(frame)}; hidden without devices. */
function deviceTable() {
  const titles = [['slots', 'slots in use, and there are'], ['queue', 'jobs that wait for a slot'],
    ['served/s', 'services that ended, per second', 'minor'], ['serves', 'the tasks of the jobs that it serves now', 'text']];
  const body = element('tbody');
  const note = element('p.soft');
  const node = element('div', {hidden: ''}, element('h2', {id: 'devices'}, 'Devices'), element('div.table.device-table', {tabindex: '0'},
    element('table', {}, element('caption.sr-only', {}, 'Devices'), element('thead', {}, element('tr', {}, element('th', {scope: 'col'}, 'device'),
      element('th.text', {scope: 'col', title: 'time of its services, as a share of its slots'}, 'busy'),
      ...titles.map(([text, help, kind = '']) => element('th', {scope: 'col', title: help, class: kind}, text)))), body)), note);
  const rows = [];
  const make = () => {
    const fill = element('div');
    const parts = {head: element('th', {scope: 'row'}), bar: element('div.bar', {}, fill), fill, share: element('span.share'),
      cells: titles.map(([text, , kind = '']) => element('td', {class: kind, 'data-label': text}))};
    return {...parts, node: element('tr', {}, parts.head, element('td.text', {'data-label': 'busy'}, element('div.busy-bar', {}, parts.bar, parts.share)), ...parts.cells)};
  };
  return {
    node,
    update({devices, devices_in_all: all}) {
      node.hidden = devices.length === 0;
      while (rows.length < devices.length) {
        rows.push(make());
        body.append(rows.at(-1).node);
      }
      while (rows.length > devices.length) rows.pop().node.remove();
      devices.forEach((device, i) => {
        const row = rows[i];
        setText(row.head, device.name);
        row.fill.style.width = `${(100 * Math.min(1, device.busy)).toFixed(1)}%`;
        setClass(row.bar, device.busy >= 0.9 ? 'bar full' : device.busy >= 0.7 ? 'bar busy' : 'bar');
        setText(row.share, formatPercent(device.busy));
        const more = device.used > device.tasks.length ? [`${device.used - device.tasks.length} more`] : [];
        const texts = [`${device.used}/${device.slots}`, formatCount(device.queued), device.rate > 0 ? String(Number(device.rate.toPrecision(4))) : '\u2013',
          [...device.tasks, ...more].join(', ')];
        texts.forEach((text, cell) => setText(row.cells[cell], text));
      });
      setText(note, all > devices.length ? `${formatCount(all - devices.length)} more devices find no room in the live page.` : '');
    },
  };
}

/** Returns the range of the classes of time of all rows: {low, high}, in ns; null without a response time. */
function timeRange(rows) {
  const least = rows.flatMap((row) => row.histogram.all.map(([ns]) => ns));
  if (least.length === 0) return null;
  const low = Math.max(1000, Math.min(...least));
  return {low, high: 1.5 * Math.max(low, ...least)};
}

/** Draws a histogram into an SVG element, on a logarithmic axis of time that all rows share. */
function drawSpread(svg, classes, range, deadline) {
  const width = 132;
  const height = 22;
  const at = (ns) => width * Math.log(Math.max(ns, range.low) / range.low) / Math.log(range.high / range.low);
  const most = Math.max(1, ...classes.map(([, count]) => count));
  const bars = classes.map(([ns, count]) => {
    const left = at(ns);
    const wide = Math.max(2, at(Math.max(ns, range.low) * 1.42) - left - 0.5);
    const high = Math.max(2, height * count / most);
    return svgElement('rect', {x: left.toFixed(1), y: (height - high).toFixed(1), width: wide.toFixed(1), height: high.toFixed(1), class: deadline && ns >= deadline ? 'late' : 'in-time'});
  });
  if (deadline && deadline > range.low && deadline < range.high) bars.push(svgElement('line', {x1: at(deadline).toFixed(1), x2: at(deadline).toFixed(1), y1: 0, y2: height}));
  svg.replaceChildren(...bars);
  const jobs = classes.reduce((sum, [, count]) => sum + count, 0);
  svg.setAttribute('aria-label', `${formatCount(jobs)} response times`);
}

const answer = (row, view) => (view.whole ? row.response : row.recent.response);
const missedCell = (row) => ({text: formatCount(row.misses), tone: row.recent.misses > 0 ? 'bad-text' : row.misses > 0 ? 'near-text' : ''});
const timeOf = (key) => (row, view) => ({text: answer(row, view)[key] > 0 ? formatTime(answer(row, view)[key]) : '\u2013', tone: toneOf(answer(row, view)[key], row)});
const count = (key) => (row) => ({text: formatCount(row[key])});
// title, help, what a cell shows, by what the rows are sorted (largest first), and whether a phone shows it
const LIVE_COLUMNS = [
  {title: 'rate/s', help: 'jobs that finished, per second', cell: (row) => ({text: row.rate > 0 ? String(Number(row.rate.toPrecision(4))) : '\u2013'}), key: (row) => row.rate},
  {title: 'p50', help: 'median response time; of a DAG end to end', cell: timeOf('p50_ns'), key: (row, view) => answer(row, view).p50_ns},
  {major: true, title: 'p99', help: '99th percentile of the response time', cell: timeOf('p99_ns'), key: (row, view) => answer(row, view).p99_ns},
  {title: 'max', help: 'longest response time', cell: timeOf('max_ns'), key: (row, view) => answer(row, view).max_ns},
  {title: 'deadline', help: 'relative deadline; of a DAG end to end', cell: (row) => ({text: formatTime(row.deadline_ns)})},
  {title: 'bound', help: 'proven bound on the response time, where one is known', cell: (row) => ({text: formatTime(row.bound_ns ?? null)})},
  {major: true, title: 'missed', help: 'jobs late, skipped or aborted since the start', cell: missedCell, key: (row) => row.recent.misses * 1e9 + row.misses},
  {title: 'lately', help: 'jobs late, skipped or aborted in the last seconds', cell: (row) => ({text: formatCount(row.recent.misses), tone: row.recent.misses > 0 ? 'bad-text' : ''}), key: (row) => row.recent.misses},
  {title: 'active', help: 'jobs that have started and not ended, and the bound on them', cell: (row) => ({text: row.max_active > 0 ? `${row.active}/${row.max_active}` : String(row.active), tone: row.max_active > 0 && row.active >= row.max_active ? 'near-text' : ''})},
  {title: 'away', help: 'active jobs that wait without a worker: for a device, an event, a time, or in a call that blocks', cell: count('away'), key: (row) => row.away},
  {title: 'ready', help: 'released jobs that could start', cell: count('ready'), key: (row) => row.ready},
  {title: 'wait', help: 'released jobs that wait for predecessors', cell: count('waiting'), key: (row) => row.waiting},
  {title: 'cpu', help: 'share of one processor, of the jobs that ended', cell: (row) => ({text: formatPercent(row.cpu)}), key: (row) => row.cpu},
];

/** Returns the rows to show: DAGs with their tasks, or sorted by a column. */
function shownRows(frame, view) {
  const dags = frame.dags.map((dag) => ({...dag, kind: 'dag', full: dag.name}));
  const tasks = frame.tasks.map((task) => ({...task, kind: 'task', full: `${task.dag}.${task.name}`}));
  const wanted = (row) => row.full.toLowerCase().includes(view.filter.toLowerCase());
  const {key} = LIVE_COLUMNS[view.column] || {};
  if (!key && !view.dagsOnly) {
    return dags.flatMap((dag) => {
      const own = tasks.filter((task) => task.dag === dag.name && wanted(task));
      return own.length > 0 || wanted(dag) ? [dag, ...own] : [];
    });
  }
  const rows = (view.dagsOnly ? dags : tasks).filter(wanted);
  return key ? rows.sort((a, b) => key(b, view) - key(a, view)) : rows;
}

/** Returns the table as {node, update(frame)}. `view` has filter, column, dagsOnly and whole. */
function liveTable(view, changed) {
  const kindOf = (column) => (column.major ? '' : 'minor');  // minor columns are not shown on a phone
  const sorts = LIVE_COLUMNS.map((column, i) => element('th', {scope: 'col', title: column.help, class: kindOf(column)}, column.key
    ? element('button', {type: 'button', onclick: () => { view.column = view.column === i ? null : i; changed(); }}, column.title) : column.title));
  const names = element('th', {scope: 'col'}, element('button', {type: 'button', title: 'by DAG', onclick: () => { view.column = null; changed(); }}, 'DAG and task'));
  const low = element('span');
  const high = element('span');
  const axis = element('th.text', {scope: 'col', title: 'how often each response time occurred, on one logarithmic axis for all rows; dashed: the deadline'},
    element('span.axis', {}, low, high));
  const body = element('tbody');
  const table = element('table', {}, element('caption.sr-only', {}, 'DAGs and tasks'),
    element('thead', {}, element('tr', {}, names, ...sorts, axis)), body);
  const note = element('p.soft');
  const kept = new Map();
  const make = (row) => {
    const cells = LIVE_COLUMNS.map(({title}) => element('td', {'data-label': title}));
    const svg = svgElement('svg', {class: 'spread', viewBox: '0 0 132 22', preserveAspectRatio: 'none', role: 'img'});
    const head = element('th', {scope: 'row'});
    return {node: element(`tr.${row.kind}`, {}, head, ...cells, element('td.text', {'data-label': 'times'}, svg)), head, cells, svg};
  };
  return {
    node: element('div', {}, element('div.table.live-table', {tabindex: '0'}, table), note),
    update(frame) {
      const all = shownRows(frame, view);
      const rows = all.slice(0, MOST_ROWS);
      const flat = view.dagsOnly || view.column !== null;
      table.parentElement.classList.toggle('flat', flat);
      sorts.forEach((head, i) => (view.column === i ? head.setAttribute('aria-sort', 'descending') : head.removeAttribute('aria-sort')));
      const range = timeRange([...frame.dags, ...frame.tasks]);
      setText(low, range === null ? 'responses' : formatTime(Number(range.low.toPrecision(2))));
      setText(high, range === null ? '' : formatTime(Number(range.high.toPrecision(2))));
      const seen = new Set();
      const order = rows.map((row) => {
        const id = `${row.kind} ${row.full}`;
        seen.add(id);
        if (!kept.has(id)) kept.set(id, make(row));
        const parts = kept.get(id);
        setText(parts.head, flat ? row.full : row.name);
        parts.head.title = row.full;
        setClass(parts.head, row.recent.misses > 0 ? 'bad-text' : '');
        LIVE_COLUMNS.forEach((column, i) => {
          const {text, tone = ''} = column.cell(row, view);
          setText(parts.cells[i], text);
          setClass(parts.cells[i], `${tone} ${kindOf(column)}`.trim());
        });
        if (range !== null) drawSpread(parts.svg, view.whole ? row.histogram.all : row.histogram.recent, range, row.deadline_ns);
        return parts.node;
      });
      for (const [id, parts] of kept) {
        if (seen.has(id)) continue;
        parts.node.remove();
        kept.delete(id);
      }
      if (order.length !== body.children.length || order.some((node, i) => body.children[i] !== node)) body.replaceChildren(...order);
      setText(note, all.length > rows.length ? `${formatCount(all.length - rows.length)} more rows: use the filter.` : all.length === 0 ? 'No name contains the filter\u2019s text.' : '');
    },
  };
}

/** Remembers the p99 of each DAG (or of each task, if there is only one DAG) and draws it over the last minutes. */
function courseFigure() {
  const lines = new Map();  // name -> [[s, ns], ...]
  let now = 0;
  let drawn = -1;  // when the chart was drawn last; once a second is enough
  const build = (t) => {
    if (lines.size === 0) return 'No response time yet.';
    const values = [...lines.values()].flat().map(([, ns]) => ns);
    const least = Math.min(...values);
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
        const ns = recent.response.p99_ns;
        if (ns <= 0) continue;
        if (!lines.has(name)) lines.set(name, []);
        const line = lines.get(name);
        if (line.length === 0 || line.at(-1)[0] < now) line.push([now, ns]);
      }
      for (const [name, line] of lines) {
        while (line.length > 0 && line[0][0] < now - COURSE_S) line.shift();
        if (line.length === 0) lines.delete(name);
      }
      const longest = [...lines].sort(([, a], [, b]) => b.at(-1)[1] - a.at(-1)[1]).slice(8);
      longest.forEach(([name]) => lines.delete(name));
      if (now - drawn < 1 && now >= drawn) return;
      drawn = now;
      const chart = fig.chart();
      if (chart === null) return fig.draw();
      const t = theme();
      chart.setOption(withTheme(build(t), t, fig.box.clientWidth), {replaceMerge: ['series']});
    },
  };
}
