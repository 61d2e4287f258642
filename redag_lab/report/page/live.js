// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The page of `redag serve`: which executor is watched, and what is said about it. The server sends a state each second.

const view = {filter: '', rows: 'all', whole: false};
const live = {source: null, chosen: null, frame: null, list: [], gone: false, lost: false};

const idOf = ({pid, number}) => (number === 0 ? String(pid) : `${pid}.${number}`);
const nameOf = (executor) => `${executor.name ?? 'not readable'} \u2013 ${executor.program ?? ''} ${idOf(executor)}`;
const inWords = (ns) => (ns < 60e9 ? `${Math.floor(ns / 1e9)} s` : ns < 3600e9 ? `${Math.floor(ns / 60e9)} min` : `${Math.floor(ns / 3600e9)} h ${Math.floor(ns % 3600e9 / 60e9)} min`);

const title = element('h1', {}, 'redag live');
const badge = element('span.state', {role: 'status'});
const facts = element('p.facts');
const misses = element('p', {id: 'headline'});
const alarm = element('p.missed', {role: 'alert'});
const picker = element('select', {'aria-label': 'executor', onchange: () => choose(picker.value)});
const pick = element('label', {}, 'executor', picker);
const workers = element('div.workers');
const devices = element('p', {id: 'devices'});
const rows = table('DAGs and tasks', LIVE_COLUMNS, [], {most: 200});  // a browser is slow with more
const content = element('div');

/** Sets the text and the class of a node if they change: screen readers say what is new. */
function say(node, text, kind) {
  if (node.textContent !== text) node.textContent = text;
  if (kind !== undefined) node.className = kind;
}

/** Returns what is wrong with the executor, or with the connection to it; '' if nothing. */
function trouble() {
  const {frame, gone, lost} = live;
  if (lost) return 'no connection';
  if (gone) return 'ended';
  const patience = Math.max(1e9, 4 * frame.interval_ns);
  return frame.age_ns > patience ? `no update for ${inWords(frame.age_ns)}` : '';
}

function show() {
  const {frame, list} = live;
  picker.replaceChildren(...list.map((executor) => element('option', {value: idOf(executor)}, nameOf(executor))));
  if (frame) picker.value = idOf(frame);
  pick.hidden = list.every((executor) => frame !== null && idOf(executor) === idOf(frame));  // nothing else to watch
  if (!frame) {
    content.hidden = true;
    say(facts, live.lost ? 'The connection to redag serve is lost. The page tries again.'
      : list.length > 0 ? 'The live page of this executor cannot be read.'
        : 'No running executor publishes a live page. The page waits for one.');
    return;
  }
  content.hidden = false;
  say(title, frame.name);
  document.title = `${frame.name} \u2013 redag live`;
  const problem = trouble();
  say(badge, problem || 'running', problem ? 'state trouble' : 'state running');
  say(facts, [`${frame.program} ${idOf(frame)}`, frame.driver, `${frame.workers} worker${frame.workers === 1 ? '' : 's'}`, `preemption ${frame.preemption}`,
    frame.policy, `up ${inWords(frame.up_ns)}`, `live page ${formatPercent(frame.page_cpu_ns / frame.up_ns)} of a processor`].join(' \u00b7 '));
  const total = frame.dags.reduce((sum, dag) => ({jobs: sum.jobs + dag.released, finished: sum.finished + dag.finished, rate: sum.rate + dag.rate, missed: sum.missed + dag.misses, lately: sum.lately + dag.recent.misses}),
    {jobs: 0, finished: 0, rate: 0, missed: 0, lately: 0});
  const jobs = `${formatCount(total.jobs)} job${total.jobs === 1 ? '' : 's'}`;
  const verdict = total.missed === 0 ? `No deadline missed, of ${jobs}`
    : `${formatCount(total.missed)} of ${jobs} missed their deadline, ${formatCount(total.lately)} in the last ${inWords(frame.window_ns)}`;
  say(misses, `${verdict} \u2013 ${formatCount(total.finished)} finished, ${Number(total.rate.toPrecision(4))}/s${frame.on_misses ? ` \u2013 ${frame.on_misses}` : ''}`,
    total.lately > 0 ? 'missed' : total.missed > 0 ? 'delay' : 'met');
  say(alarm, [frame.alert, problem.startsWith('no update') ? 'The process is stopped, or gets no processor.' : null,
    frame.left_out > 0 ? `${formatCount(frame.left_out)} more tasks do not fit the live page.` : null].filter(Boolean).join(' '));
  patch(workers, workerBars(frame));
  say(devices, devicesInWords(frame));
  rows.update(liveRows(frame, view));
}

function receive({data}) {
  const {list, frame} = JSON.parse(data);
  live.list = list.executors;
  live.lost = false;
  live.gone = frame === null;
  if (frame !== null) live.frame = frame;
  show();
  document.documentElement.dataset.ready = 'true';
}

/** Watches an executor, or the first one. */
function watch(executor) {
  if (live.source !== null) live.source.close();
  live.source = new EventSource(executor === null ? 'events' : `events?executor=${encodeURIComponent(executor)}`);
  live.source.onmessage = receive;
  live.source.onerror = () => {
    live.lost = true;
    show();
    // A browser gives up where the answer was an error, such as too many windows.
    if (live.source.readyState === EventSource.CLOSED) setTimeout(() => watch(live.chosen), 3000);
  };
}

function choose(executor) {
  live.chosen = executor;
  live.frame = null;
  watch(executor);
}

const filter = element('input', {type: 'search', placeholder: 'filter names', 'aria-label': 'filter names', oninput: () => { view.filter = filter.value; if (live.frame) show(); }});
const ROWS = ['all', 'DAGs', 'tasks'];
content.append(misses, alarm, workers, devices, element('h2', {id: 'table'}, 'DAGs and tasks'),
  element('div.row.controls', {}, filter, choice('Response times', ['of the last seconds', 'since the start'], 0, (i) => { view.whole = i === 1; show(); }),
    choice('Rows', ROWS, 0, (i) => { view.rows = ROWS[i]; show(); })),
  rows);
content.hidden = true;
document.documentElement.dataset.theme = themeName();
document.getElementById('report').append(
  element('div.head', {}, element('div.title', {}, title, badge), element('div.controls', {}, themeChoice())), facts, element('div.row', {}, pick), content,
  element('footer', {}, 'This page is served by redag serve on this machine; it changes nothing.'));
applyTheme();
show();
watch(null);
