// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws the schedule: which job ran where and when. Rows are tasks (with releases, deadlines and misses), or workers
// and the slots of devices.

const [OPEN, PREEMPTED, WAITS] = [valueOf(ENDS, 'open'), valueOf(ENDS, 'preempted'), valueOf(ENDS, 'waits')];
const [FINISHED, SKIPPED] = [valueOf(OUTCOMES, 'finished'), valueOf(OUTCOMES, 'skipped')];
const ROW_HEIGHT = 30;
const MOST_ROWS = 64;
const HATCH = 'rgba(255,255,255,.45)';  // a job at a device
const ROOM_FOR_ARROWS = 9;  // pixels from release to deadline; with fewer, only misses are marked

/** `explain(task, number, missed)` is called for a job that the reader clicks on. */
function scheduleFigure(groups, state, explain) {
  let zoom = null;   // the visible range, kept when the theme changes

  // Returns the jobs and slices of the chosen window as rows for ECharts. Times are in ns since the start of the run.
  function contents() {
    const group = groups[state.executor];
    const view = group.schedule.views[state.view] || group.schedule.views[0];
    const seen = group.schedule.windows[view.window];
    const {jobs, slices, services} = seen;
    const start = group.run.start_ns;
    const from = seen.begin_ns - start;
    const used = state.rows === 'workers' ? [] : tasksOf(jobs, slices, view.task);
    const rows = state.rows === 'workers'
      ? [...Array.from({length: group.run.config.workers}, (_, w) => workerName(group, w)), ...slotsOf(group, services).map(({name}) => name)].slice(0, MOST_ROWS)
      : used.map((task) => taskName(group, task));
    const rowOf = new Map(used.map((task, i) => [task, i]));
    const row = (task, worker) => (state.rows === 'workers' ? worker : rowOf.get(task));
    const shown = ([place]) => place !== undefined && place < rows.length;
    const bars = slices.task.map((task, i) => [
      row(task, slices.worker[i]), from + slices.begin[i], from + slices.begin[i] + slices.length[i], i]).filter(shown);
    const marks = state.rows === 'workers' ? [] : jobs.task.map((task, i) => [
      rowOf.get(task), from + jobs.release[i], from + jobs.release[i] + jobs.deadline[i], i]).filter(shown);
    const slotRow = new Map(slotsOf(group, services).map(({device, slot}, i) => [`${device}/${slot}`, group.run.config.workers + i]));
    const served = services.task.map((task, i) => [
      state.rows === 'workers' ? slotRow.get(`${services.device[i]}/${services.slot[i]}`) : rowOf.get(task),
      from + services.begin[i], from + services.begin[i] + services.length[i], i]).filter(shown);
    // A wait lasts until the job's next slice.
    const next = new Map();
    const resumed = new Array(slices.task.length).fill(null);
    for (let i = slices.task.length - 1; i >= 0; --i) {
      const job = `${slices.task[i]}/${slices.job[i]}`;
      if (slices.how[i] === WAITS) resumed[i] = next.has(job) ? next.get(job) : seen.end_ns - start;
      next.set(job, from + slices.begin[i]);
    }
    return {group, view, jobs, slices, services, rows, bars, marks, served, resumed, from, to: seen.end_ns - start, start};
  }

  /** Returns the slots of devices with a row: the first of each device, and the others as far as they are used. */
  function slotsOf(group, services) {
    return group.devices.flatMap(({name, slots}, device) => {
      const last = Math.max(0, ...services.slot.filter((_, i) => services.device[i] === device));
      return Array.from({length: last + 1}, (_, slot) => ({device, slot, name: slots > 1 ? `${name}, slot ${slot + 1}` : name}));
    });
  }

  // Workers are numbered through all clusters.
  function workerName(group, worker) {
    let first = 0;
    const cluster = group.clusters.find(({workers}) => worker < (first += workers));
    return cluster ? `worker ${worker} (${cluster.name})` : `worker ${worker}`;
  }

  // Returns the tasks with a row. If not all fit, tasks that missed deadlines precede the first ones.
  function tasksOf(jobs, slices, wanted) {
    const missing = new Set(jobs.task.filter((_, i) => jobs.missed[i] === 1));
    const rank = (task) => (task === wanted ? 0 : missing.has(task) ? 1 : 2);
    return [...new Set([...jobs.task, ...slices.task])].sort((a, b) => rank(a) - rank(b) || a - b).slice(0, MOST_ROWS)
      .sort((a, b) => a - b);
  }

  function outcomeOf(jobs, j) {
    const reason = wordsAt(REASONS, jobs.reason[j]);
    return `${wordsAt(OUTCOMES, jobs.outcome[j])}${reason ? `: ${reason}` : ''}`;
  }

  function describeJob(c, j) {
    const {jobs} = c;
    const task = c.group.tasks[jobs.task[j]];
    const finished = jobs.finish[j] !== null && jobs.outcome[j] === FINISHED;
    const late = finished ? jobs.finish[j] - jobs.deadline[j] : 0;
    return [
      `${taskName(c.group, jobs.task[j])} #${jobs.number[j]}`,
      `released ${formatTime(c.from + jobs.release[j])}, deadline ${formatTime(jobs.deadline[j])} later`,
      finished ? `response ${formatTime(jobs.finish[j])}${task.bound_ns ? `, bound ${formatTime(task.bound_ns)}` : ''}`
        : outcomeOf(jobs, j),
      late > 0 ? `late by ${formatTime(late)}` : null,
    ];
  }

  const fig = figure({
    name: 'schedule', height: 300, canvas: true, label: 'Schedule', zooms: true,
    data() {
      const {group, jobs, from} = contents();
      return {
        columns: [column('job'), column('released'), column('deadline'), column('finished after'), column('outcome', '', true)],
        rows: jobs.task.map((task, j) => ({cells: [`${taskName(group, task)} #${jobs.number[j]}`, timeCell(from + jobs.release[j]), timeCell(jobs.deadline[j]),
          timeCell(jobs.finish[j]), {text: `${outcomeOf(jobs, j)}${jobs.missed[j] ? ', missed' : ''}`, kind: jobs.missed[j] ? 'missed' : ''}]})),
      };
    },
    caption: 'Drag to move; zoom with Ctrl and the wheel, or with two fingers. Colour: DAG; \u2191 release; \u2193 deadline; red: missed deadline; '
      + `\u00d7 lost job. A slice that ends with a notch was preempted. A thin line is a wait without a worker, a hatched part of it the time at a device. A click explains a job. At most ${MOST_ROWS} rows are shown, those with misses first.`,
    build(t) {
      const c = contents();
      const inTasks = state.rows === 'tasks';
      const clip = (params, shape) => echarts.clipRectByRect(shape, params.coordSys);
      if (zoom === null) zoom = firstLook(c);
      Object.assign(fig.box.dataset, {from: zoom[0], to: zoom[1]});  // for tests: the canvas does not tell
      fig.resize(Math.max(160, 96 + ROW_HEIGHT * c.rows.length));
      const missed = (i) => c.slices.job[i] !== null && c.jobs.missed[c.slices.job[i]] === 1;
      return {
        grid: {left: 8, right: 16, top: 34, bottom: 52, containLabel: true},
        tooltip: {
          trigger: 'item',
          formatter: (item) => {
            const i = item.value[3];
            if (item.seriesName === 'jobs') return tip(describeJob(c, i));
            if (item.seriesName === 'devices') {
              const at = c.services.job[i];
              return tip([...(at === null ? [taskName(c.group, c.services.task[i])] : describeJob(c, at)),
                `${c.group.devices[c.services.device[i]].name}: ${formatTime(c.services.length[i])} from ${formatTime(item.value[1])}`]);
            }
            const j = c.slices.job[i];
            const job = j === null ? [taskName(c.group, c.slices.task[i])] : describeJob(c, j);
            return tip([...job, `${workerName(c.group, c.slices.worker[i])}: ${formatTime(c.slices.length[i])} from ${formatTime(item.value[1])}`,
              wordsAt(ENDS, c.slices.how[i])]);
          },
        },
        dataZoom: [
          {type: 'inside', startValue: zoom[0], endValue: zoom[1], filterMode: 'weakFilter', minValueSpan: 100,
            zoomOnMouseWheel: 'ctrl', preventDefaultMouseMove: false},
          {type: 'slider', startValue: zoom[0], endValue: zoom[1], filterMode: 'weakFilter', height: 18, bottom: 4,
            showDetail: false, brushSelect: false, borderColor: t.line, backgroundColor: t.raised,
            fillerColor: t.dark ? 'rgba(228,232,237,.18)' : 'rgba(27,31,36,.14)', handleStyle: {color: t.paper, borderColor: t.soft},
            moveHandleStyle: {color: t.line}},
        ],
        xAxis: {
          type: 'value', min: c.from, max: c.to, splitNumber: 6,
          axisLabel: {showMaxLabel: false, formatter: (value) => formatAxisTime(value, (zoom[1] - zoom[0]) / 50)},
        },
        yAxis: {
          type: 'category', data: c.rows, inverse: true, axisTick: {show: false}, splitLine: {show: true},
          axisLabel: {color: t.ink, width: Math.min(170, window.innerWidth * 0.24), overflow: 'truncate', interval: 0, fontSize: 11.5},
        },
        series: [
          {
            type: 'custom', name: 'jobs', data: c.marks, encode: {x: [1, 2], y: 0}, z: 3, progressive: 0,
            renderItem: (params, api) => {
              const i = api.value(3);
              const [x0, y] = api.coord([api.value(1), api.value(0)]);
              const [x1] = api.coord([api.value(2), api.value(0)]);
              const half = ROW_HEIGHT * 0.46;
              const {x: left, width} = params.coordSys;
              const bad = c.jobs.missed[i] === 1;
              const children = [];
              const arrow = (x, up, colour) => {
                if (x < left - 0.5 || x > left + width + 0.5) return;
                const head = up ? y - half : y + half - 1;
                const d = up ? 4 : -4;
                children.push({type: 'line', shape: {x1: x, x2: x, y1: y - half, y2: y + half - 1}, style: {stroke: colour, lineWidth: bad && !up ? 1.6 : 1}});
                children.push({type: 'polygon', shape: {points: [[x, head], [x - 2.6, head + d], [x + 2.6, head + d]]}, style: {fill: colour}});
              };
              if (x1 - x0 < ROOM_FOR_ARROWS) {
                if (!bad || x1 < left || x1 > left + width) return null;
                return {type: 'line', shape: {x1, x2: x1, y1: y + 2, y2: y + half}, style: {stroke: t.missed, lineWidth: 1, opacity: 0.7}};
              }
              arrow(x0, true, t.soft);
              arrow(x1, false, bad ? t.missed : t.soft);
              const lost = c.jobs.outcome[i] >= SKIPPED && bad;
              if (lost) {
                const x = Math.max(x0 + 7, left + 5);
                if (x < left + width - 4) children.push({type: 'path', shape: {pathData: 'M0 0L8 8M8 0L0 8', x: x - 4, y: y - 4, width: 8, height: 8},
                  style: {stroke: t.missed, lineWidth: 2, fill: 'none'}});
              }
              return children.length === 0 ? null : {type: 'group', children};
            },
          },
          {
            type: 'custom', name: 'schedule', data: c.bars, encode: {x: [1, 2], y: 0}, z: 2, progressive: 0,
            renderItem: (params, api) => {
              const i = api.value(3);
              const [x0, y] = api.coord([api.value(1), api.value(0)]);
              const [x1] = api.coord([api.value(2), api.value(0)]);
              const height = ROW_HEIGHT * (inTasks ? 0.56 : 0.74);
              const box = clip(params, {x: x0, y: y - height / 2, width: Math.max(1, x1 - x0), height});
              if (!box) return null;
              const bad = missed(i);
              const colour = hueOf(t, c.group.tasks[c.slices.task[i]].dag).color;
              const children = [{type: 'rect', shape: {...box, r: box.width > 4 ? 2 : 0},
                style: {fill: colour, opacity: c.slices.how[i] === OPEN ? 0.55 : 0.92, stroke: bad ? t.missed : 'transparent', lineWidth: bad && box.width > 2 ? 2 : 0}}];
              if (c.slices.how[i] === PREEMPTED && box.width > 5) {
                const right = box.x + box.width;
                children.push({type: 'polygon', shape: {points: [[right + 0.5, box.y], [right - 4, y], [right + 0.5, box.y + height]]}, style: {fill: t.paper}});
              }
              const wait = inTasks && c.resumed[i] !== null
                && clip(params, {x: x1, y: y - 1, width: Math.max(1, api.coord([c.resumed[i], api.value(0)])[0] - x1), height: 2});
              if (wait) children.push({type: 'rect', silent: true, shape: wait, style: {fill: colour, opacity: 0.6}});
              if (!inTasks && box.width > 34) {
                children.push({type: 'text', silent: true, style: {text: c.group.tasks[c.slices.task[i]].name, x: box.x + 4, y, fontSize: 11,
                  width: box.width - 8, overflow: 'truncate', ellipsis: '', textVerticalAlign: 'middle', fill: t.paper}});
              }
              return {type: 'group', children};
            },
          },
          {
            // A job at a device: in a task's row on the thin line of its wait.
            type: 'custom', name: 'devices', data: c.served, encode: {x: [1, 2], y: 0}, z: 2, progressive: 0,
            renderItem: (params, api) => {
              const i = api.value(3);
              const [x0, y] = api.coord([api.value(1), api.value(0)]);
              const [x1] = api.coord([api.value(2), api.value(0)]);
              const height = ROW_HEIGHT * (inTasks ? 0.3 : 0.74);
              const box = clip(params, {x: x0, y: y - height / 2, width: Math.max(1, x1 - x0), height});
              if (!box) return null;
              const colour = hueOf(t, c.group.tasks[c.services.task[i]].dag).color;
              const children = [{type: 'rect', shape: {...box, r: box.width > 4 ? 2 : 0}, style: {fill: colour, opacity: 0.92}}];
              for (let x = box.x + 3; inTasks && x + 4 < box.x + box.width; x += 6) {
                children.push({type: 'line', silent: true, shape: {x1: x, x2: x + 4, y1: box.y + box.height, y2: box.y}, style: {stroke: HATCH, lineWidth: 1.5}});
              }
              if (!inTasks && box.width > 34) {
                children.push({type: 'text', silent: true, style: {text: c.group.tasks[c.services.task[i]].name, x: box.x + 4, y, fontSize: 11,
                  width: box.width - 8, overflow: 'truncate', ellipsis: '', textVerticalAlign: 'middle', fill: t.paper}});
              }
              return {type: 'group', children};
            },
          },
        ],
      };
    },
    onready(chart) {
      chart.on('click', ({value, seriesName}) => {
        const {jobs, slices, services} = contents();
        const j = seriesName === 'jobs' ? value[3] : (seriesName === 'devices' ? services : slices).job[value[3]];
        if (j !== null && j !== undefined) explain(jobs.task[j], jobs.number[j], jobs.missed[j] === 1);
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
  const all = group.schedule.slices_shown === group.schedule.slices_in_all;
  return group.schedule.views.map(({task, job, missed, lateness_ns: lateness}) => {
    if (task === undefined) return all ? 'the whole run' : 'the beginning';
    const how = lateness > 0 ? `${formatTime(lateness)} late` : missed ? 'missed' : `${formatTime(-lateness)} to spare`;
    return `${taskName(group, task)} #${job}, ${how}`;
  });
}
