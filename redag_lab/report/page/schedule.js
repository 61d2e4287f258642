// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws the schedule: which job ran when, with releases, deadlines and misses. Each task has a row.

const [OPEN, PREEMPTED, WAITS] = ['open', 'preempted', 'waits'].map((name) => valueOf(ENDS, name));
const [FINISHED, SKIPPED] = ['finished', 'skipped'].map((name) => valueOf(OUTCOMES, name));
const ROW_HEIGHT = 30;
const MOST_ROWS = 64;
const ROOM_FOR_ARROWS = 9;  // pixels from release to deadline; with fewer, only misses are marked

// Workers are numbered through all clusters.
function workerName(group, worker) {
  let first = 0;
  const cluster = group.clusters.find(({workers}) => worker < (first += workers));
  return cluster ? `worker ${worker} (${cluster.name})` : `worker ${worker}`;
}

// Returns the tasks that have a row. If not all fit, those that missed deadlines precede the first ones.
function tasksOf({jobs, slices}, wanted) {
  const missing = new Set(jobs.task.filter((_, i) => jobs.missed[i] === 1));
  const rank = (task) => (task === wanted ? 0 : missing.has(task) ? 1 : 2);
  return [...new Set([...jobs.task, ...slices.task])].sort((a, b) => rank(a) - rank(b) || a - b).slice(0, MOST_ROWS)
    .sort((a, b) => a - b);
}

/** `explain(task, number, missed)` is called for a job that the reader clicks on. */
function scheduleFigure(groups, state, explain) {
  let zoom = null;   // the visible range, kept when the theme changes

  // Returns the jobs and slices of the chosen window, with places [row, begin, end, index] for ECharts. Times are in ns
  // since the start of the run.
  function contents() {
    const group = groups[state.executor];
    const view = group.schedule.views[state.view] || group.schedule.views[0];
    const seen = group.schedule.windows[view.window];
    const {jobs, slices} = seen;
    const start = group.run.start_ns;
    const from = seen.begin_ns - start;
    const tasks = tasksOf(seen, view.task);
    const rowOf = new Map(tasks.map((task, row) => [task, row]));
    const placed = (all, lengths, begins) => all.task.map((task, i) => [rowOf.get(task), from + begins[i], from + begins[i] + lengths[i], i]).filter(([row]) => row !== undefined);
    // A wait lasts until the job's next slice on a worker.
    const next = new Map();
    const resumed = new Array(slices.task.length).fill(null);
    for (let i = slices.task.length - 1; i >= 0; --i) {
      if (slices.device[i] !== null) continue;
      const job = `${slices.task[i]}/${slices.job[i]}`;
      if (slices.how[i] === WAITS) resumed[i] = next.has(job) ? next.get(job) : seen.end_ns - start;
      next.set(job, from + slices.begin[i]);
    }
    return {group, view, jobs, slices, rows: tasks.map((task) => taskName(group, task)), bars: placed(slices, slices.length, slices.begin),
      marks: placed(jobs, jobs.deadline, jobs.release), resumed, from, to: seen.end_ns - start, start};
  }

  function describeJob(c, j) {
    const {jobs} = c;
    const {bound_ns: bound} = c.group.tasks[jobs.task[j]];
    const isFinished = jobs.finish[j] !== null && jobs.outcome[j] === FINISHED;
    const late = isFinished ? jobs.finish[j] - jobs.deadline[j] : 0;
    const reason = wordsAt(REASONS, jobs.reason[j]);
    return [
      `${taskName(c.group, jobs.task[j])} #${jobs.number[j]}`,
      `released ${formatTime(c.from + jobs.release[j])}, deadline ${formatTime(jobs.deadline[j])} later`,
      isFinished ? `response ${formatTime(jobs.finish[j])}${bound ? `, bound ${formatTime(bound)}` : ''}`
        : `${wordsAt(OUTCOMES, jobs.outcome[j])}${reason ? `: ${reason}` : ''}`,
      late > 0 ? `late by ${formatTime(late)}` : null,
    ];
  }

  function describeSlice(c, i, begin) {
    const {device, worker, task, job, length, how} = c.slices;
    const where = device[i] === null ? workerName(c.group, worker[i]) : c.group.devices[device[i]].name;
    return [...(job[i] === null ? [taskName(c.group, task[i])] : describeJob(c, job[i])),
      `${where}: ${formatTime(length[i])} from ${formatTime(begin)}`, wordsAt(ENDS, how[i])];
  }

  // Draws a job's release and deadline, and whether it was lost.
  function drawMarks(c, t, params, api) {
    const i = api.value(3);
    const [x0, y] = api.coord([api.value(1), api.value(0)]);
    const [x1] = api.coord([api.value(2), api.value(0)]);
    const half = ROW_HEIGHT * 0.46;
    const {x: left, width} = params.coordSys;
    const isMissed = c.jobs.missed[i] === 1;
    const children = [];
    const arrow = (x, up, colour) => {
      if (x < left - 0.5 || x > left + width + 0.5) return;
      const head = up ? y - half : y + half - 1;
      const d = up ? 4 : -4;
      children.push({type: 'line', shape: {x1: x, x2: x, y1: y - half, y2: y + half - 1}, style: {stroke: colour, lineWidth: isMissed && !up ? 1.6 : 1}});
      children.push({type: 'polygon', shape: {points: [[x, head], [x - 2.6, head + d], [x + 2.6, head + d]]}, style: {fill: colour}});
    };
    if (x1 - x0 < ROOM_FOR_ARROWS) {
      if (!isMissed || x1 < left || x1 > left + width) return null;
      return {type: 'line', shape: {x1, x2: x1, y1: y + 2, y2: y + half}, style: {stroke: t.missed, lineWidth: 1, opacity: 0.7}};
    }
    arrow(x0, true, t.soft);
    arrow(x1, false, isMissed ? t.missed : t.soft);
    const x = Math.max(x0 + 7, left + 5);
    if (c.jobs.outcome[i] >= SKIPPED && isMissed && x < left + width - 4) {
      children.push({type: 'path', shape: {pathData: 'M0 0L8 8M8 0L0 8', x: x - 4, y: y - 4, width: 8, height: 8}, style: {stroke: t.missed, lineWidth: 2, fill: 'none'}});
    }
    return children.length === 0 ? null : {type: 'group', children};
  }

  // Draws a slice. One at a device is hatched and stands on the thin line of its wait.
  function drawSlice(c, t, params, api) {
    const i = api.value(3);
    const {slices} = c;
    const isAtDevice = slices.device[i] !== null;
    const [x0, y] = api.coord([api.value(1), api.value(0)]);
    const [x1] = api.coord([api.value(2), api.value(0)]);
    const clip = (shape) => echarts.clipRectByRect(shape, params.coordSys);
    const height = ROW_HEIGHT * (isAtDevice ? 0.3 : 0.56);
    const box = clip({x: x0, y: y - height / 2, width: Math.max(1, x1 - x0), height});
    if (!box) return null;
    const right = box.x + box.width;
    const isMissed = !isAtDevice && slices.job[i] !== null && c.jobs.missed[slices.job[i]] === 1;
    const {color} = hueOf(t, c.group.tasks[slices.task[i]].dag);
    const children = [{type: 'rect', shape: {...box, r: box.width > 4 ? 2 : 0},
      style: {fill: color, opacity: slices.how[i] === OPEN ? 0.55 : 0.92, stroke: isMissed ? t.missed : 'transparent', lineWidth: isMissed && box.width > 2 ? 2 : 0}}];
    if (slices.how[i] === PREEMPTED && box.width > 5) {
      children.push({type: 'polygon', shape: {points: [[right + 0.5, box.y], [right - 4, y], [right + 0.5, box.y + height]]}, style: {fill: t.paper}});
    }
    const wait = c.resumed[i] !== null && clip({x: x1, y: y - 1, width: Math.max(1, api.coord([c.resumed[i], api.value(0)])[0] - x1), height: 2});
    if (wait) children.push({type: 'rect', silent: true, shape: wait, style: {fill: color, opacity: 0.6}});
    for (let x = box.x + 3; isAtDevice && x + 4 < right; x += 6) {
      children.push({type: 'line', silent: true, shape: {x1: x, x2: x + 4, y1: box.y + box.height, y2: box.y}, style: {stroke: 'rgba(255,255,255,.45)', lineWidth: 1.5}});
    }
    return {type: 'group', children};
  }

  const fig = figure({
    name: 'schedule', height: 300, canvas: true, label: 'Schedule', zooms: true,
    caption: 'Drag to move; zoom with Ctrl and the wheel, or with two fingers. Colour: DAG; \u2191 release; \u2193 deadline; red: missed deadline; '
      + `\u00d7 lost job. A slice that ends with a notch was preempted. A thin line is a wait without a worker, a hatched part of it the time at a device. A click explains a job. At most ${MOST_ROWS} rows are shown, those with misses first.`,
    build(t) {
      const c = contents();
      if (zoom === null) zoom = firstLook(c);
      Object.assign(fig.box.dataset, {from: zoom[0], to: zoom[1]});  // for tests: the canvas does not tell
      fig.resize(Math.max(160, 96 + ROW_HEIGHT * c.rows.length));
      const range = {startValue: zoom[0], endValue: zoom[1], filterMode: 'weakFilter'};
      return {
        grid: {left: 8, right: 16, top: 34, bottom: 52, containLabel: true},
        tooltip: {trigger: 'item', formatter: ({seriesName, value}) => tip(seriesName === 'jobs' ? describeJob(c, value[3]) : describeSlice(c, value[3], value[1]))},
        dataZoom: [
          {type: 'inside', ...range, minValueSpan: 100, zoomOnMouseWheel: 'ctrl', preventDefaultMouseMove: false},
          {type: 'slider', ...range, height: 18, bottom: 4, showDetail: false, brushSelect: false, borderColor: t.line, backgroundColor: t.raised,
            fillerColor: t.dark ? 'rgba(228,232,237,.18)' : 'rgba(27,31,36,.14)', handleStyle: {color: t.paper, borderColor: t.soft}, moveHandleStyle: {color: t.line}},
        ],
        xAxis: {
          type: 'value', min: c.from, max: c.to, splitNumber: 6,
          axisLabel: {showMaxLabel: false, formatter: (value) => formatAxisTime(value, (zoom[1] - zoom[0]) / 50)},
        },
        yAxis: {
          type: 'category', data: c.rows, inverse: true, axisTick: {show: false}, splitLine: {show: true},
          axisLabel: {color: t.ink, width: Math.min(170, window.innerWidth * 0.24), overflow: 'truncate', interval: 0, fontSize: 11.5},
        },
        series: [['jobs', c.marks, drawMarks, 3], ['slices', c.bars, drawSlice, 2]].map(([name, data, draw, z]) => ({
          type: 'custom', name, data, encode: {x: [1, 2], y: 0}, z, progressive: 0, renderItem: (params, api) => draw(c, t, params, api),
        })),
      };
    },
    onready(chart) {
      chart.on('click', ({value, seriesName}) => {
        const {jobs, slices} = contents();
        const j = seriesName === 'jobs' ? value[3] : slices.job[value[3]];
        if (j !== null) explain(jobs.task[j], jobs.number[j], jobs.missed[j] === 1);
      });
      chart.on('datazoom', () => {
        const {startValue, endValue} = chart.getOption().dataZoom[0];
        zoom = [startValue, endValue];
      });
    },
  });

  // Returns the initial range. A worst job shows its surroundings; the beginning shows as many jobs as fit.
  function firstLook(c) {
    if (c.view.task !== undefined) return [c.view.begin_ns - c.start, c.view.end_ns - c.start];
    const count = window.innerWidth < 640 ? 50 : 120;
    const {release} = c.jobs;
    const until = release.length > count ? c.from + release[count] : c.to;
    return [c.from, until > c.from ? until : c.to];
  }

  fig.look = () => {
    zoom = null;
    fig.draw();
  };
  return fig;
}

/** Returns the names of the views: "control.pid #12, 2.1 ms late", "the beginning". */
function viewNames(group) {
  return group.schedule.views.map(({task, job, missed, lateness_ns: lateness}) => {
    if (task === undefined) return group.schedule.is_whole ? 'the whole run' : 'the beginning';
    const how = lateness > 0 ? `${formatTime(lateness)} late` : missed ? 'missed' : `${formatTime(-lateness)} to spare`;
    return `${taskName(group, task)} #${job}, ${how}`;
  });
}
