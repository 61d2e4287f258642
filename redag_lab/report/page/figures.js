// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Figures of many jobs: distributions of responses, lateness, the whole run, and executors side by side.

const LATENESS_CLASSES = 80;  // on [-1, 1) deadlines; the last count holds all larger values

const MOST_LINES = 24;        // that a figure can show legibly

const taskName = (group, task) => `${group.dags[group.tasks[task].dag].name}.${group.tasks[task].name}`;
const hasCurve = (task) => task.responses !== undefined && task.responses.value_ns.length > 0;

const awaitedOf = ({jobs}) => jobs.missed + jobs.finished - jobs.late;  // finished, lost or overdue

/**
 * Returns the share of jobs that had finished by each time. Lost jobs never finish, and jobs in progress at the end are
 * left out.
 */
function distribution(task, scale, tail) {
  const awaited = awaitedOf(task);
  const points = task.responses.value_ns.map((ns, i) => {
    const share = task.responses.count[i] / Math.max(1, awaited);
    return [ns / scale, tail ? 1 - share : share];
  });
  const first = [points[0][0], tail ? 1 : 0];
  // A logarithmic axis has no zero: the curve ends where no job is slower.
  return [first, ...points].filter(([, share]) => !tail || share > 1e-12);
}

const LIMITS = {deadline: 'dashed', bound: 'dotted'};

/** Returns a vertical line at a deadline or a bound. */
function limitLine(t, x, kind, position = 'end') {
  return {
    xAxis: x, lineStyle: {color: t.ink, type: LIMITS[kind], width: 1.6}, symbol: 'none',
    label: {formatter: () => kind, color: t.ink, position, distance: 4},
  };
}

/** Returns the smallest response that at least this share of the awaited jobs kept to; null if too many were lost. */
function quantile(task, share) {
  const {value_ns: values, count} = task.responses;
  const wanted = share * awaitedOf(task);
  const at = count.findIndex((jobs) => jobs >= wanted);
  return at < 0 ? null : values[at];
}

/**
 * Draws response times: of one task under every executor, with deadline and bounds, or of all tasks of one executor,
 * each as a share of its deadline.
 */
function responseFigure(groups, state) {
  const nameOfChosen = () => (state.task === null ? null : taskName(groups[state.executor], state.task));
  function lines() {
    const name = nameOfChosen();
    const all = groups.flatMap((group, g) => (name === null && g !== state.executor ? [] : group.tasks.map((task, i) => ({group, g, task, i}))))
      .filter(({group, task, i}) => hasCurve(task) && (name === null || taskName(group, i) === name));
    if (all.length <= MOST_LINES) return all;
    const closeness = ({task}) => task.jobs.response.max_ns / task.deadline_ns;
    return all.sort((a, b) => closeness(b) - closeness(a)).slice(0, MOST_LINES);
  }
  const lineName = ({group, i}) => (state.task === null ? taskName(group, i) : group.label);
  return figure({
    name: 'responses', height: 368, label: 'Distribution of response times', zooms: true,
    caption: 'Response time: finish \u2212 nominal release. Lost jobs never finish: a task with lost jobs has a '
      + `curve that ends below 1. At most ${MOST_LINES} tasks are shown, the closest to their deadlines. Click the legend to hide or show a line.`,
    data: () => ({
      columns: [column(state.task === null ? 'task' : 'executor'), column('deadline'), ...[50, 90, 95, 99].map((p) => column(`p${p}`)), column('max'), column('finished')],
      rows: lines().map((line) => ({cells: [lineName(line), timeCell(line.task.deadline_ns), ...[0.5, 0.9, 0.95, 0.99].map((share) => timeCell(quantile(line.task, share))),
        timeCell(line.task.jobs.response.max_ns), shareCell(line.task.jobs.finished, line.task.jobs.released)]})),
    }),
    build(t, width) {
      const one = state.task !== null;
      const drawn = lines();
      if (drawn.length === 0) return 'No job of this task finished.';
      const mark = one ? groups[state.executor].tasks[state.task] : null;
      const marks = one
        ? [limitLine(t, mark.deadline_ns, 'deadline'), ...(mark.bound_ns === null ? [] : [limitLine(t, mark.bound_ns, 'bound', 'insideEndTop')])]
        : [limitLine(t, 1, 'deadline')];
      const most = Math.max(...drawn.map(({task}) => task.responses.value_ns[task.responses.value_ns.length - 1]
        / (one ? 1 : task.deadline_ns)));
      const edge = one ? Math.max(mark.deadline_ns, mark.bound_ns || 0) : 1;
      return {
        grid: {left: 8, right: 24, top: 66, bottom: 34, containLabel: true},
        legend: {},
        tooltip: {
          trigger: 'item',
          formatter: (item) => tip([item.seriesName, `${one ? formatTime(item.value[0]) : `${item.value[0].toFixed(3)} of the deadline`}`,
            state.tail ? `longer: ${formatPercent(item.value[1])} of the jobs` : `finished: ${formatPercent(item.value[1])} of the jobs`]),
        },
        dataZoom: [{type: 'inside', filterMode: 'none', zoomOnMouseWheel: 'ctrl', preventDefaultMouseMove: false}],
        xAxis: {
          type: state.log ? 'log' : 'value', name: one ? 'response' : 'response / deadline', nameLocation: 'middle', nameGap: 32,
          min: state.log ? undefined : 0, max: state.log ? undefined : Math.max(most, edge) * 1.03,
          splitNumber: width < 500 ? 3 : 6,
          axisLabel: {showMaxLabel: false, formatter: (value) => (one ? formatAxisTime(value, most / 20) : String(Number(value.toPrecision(3))))},
        },
        yAxis: state.tail
          ? {type: 'log', max: 1, name: 'share of jobs that take longer', nameGap: 24, nameTextStyle: {align: 'left'},
            axisLabel: {formatter: (value) => String(value)}}
          : {type: 'value', min: 0, max: 1, name: 'share of jobs', nameGap: 24, nameTextStyle: {align: 'left'}},
        series: drawn.map((line, k) => {
          const look = one ? shadeOf(t, line.g) : {color: hueOf(t, line.task.dag).color, dash: DASHES[placeInDag(line) % DASHES.length]};
          return {
            type: 'line', name: lineName(line), step: 'end', showSymbol: false, symbolSize: 8,
            triggerLineEvent: true, data: distribution(line.task, one ? 1 : line.task.deadline_ns, state.tail),
            lineStyle: {width: 2, type: look.dash}, itemStyle: {color: look.color},
            markLine: k === 0 ? {symbol: 'none', silent: true, data: marks, animation: false} : undefined,
          };
        }),
      };
    },
  });
}

/** Returns how many tasks of its DAG come before the task of a line. */
const placeInDag = ({group, i}) => i - group.tasks.findIndex((task) => task.dag === group.tasks[i].dag);

/** Draws how early or late jobs finished, in classes of 1/40 of the deadline. */
function latenessFigure(groups, state) {
  const half = LATENESS_CLASSES / 2;
  const latenessClass = (i) => (i === LATENESS_CLASSES ? 'more than one deadline late'
    : `${((i - half) / half).toFixed(3)} to ${((i + 1 - half) / half).toFixed(3)} of the deadline`);
  function latenessByDag() {
    const group = groups[state.executor];
    const byDag = group.dags.map(() => new Array(LATENESS_CLASSES + 1).fill(0));
    const tasks = state.task !== null ? [group.tasks[state.task]] : group.tasks;
    tasks.forEach((task) => (task.lateness || []).forEach((count, i) => { byDag[task.dag][i] += count; }));
    return byDag;
  }
  return figure({
    name: 'lateness', height: 308, label: 'Histogram of lateness',
    data() {
      const group = groups[state.executor];
      const counts = latenessByDag();
      const classes = Array.from({length: LATENESS_CLASSES + 1}, (_, i) => i).filter((i) => counts.some((dag) => dag[i] > 0));
      return {
        columns: [column('lateness / deadline'), ...group.dags.map((dag) => column(dag.name))],
        rows: classes.map((i) => ({cells: [{text: latenessClass(i), sort: i}, ...counts.map((dag) => countCell(dag[i]))]})),
      };
    },
    caption: 'Lateness: finish \u2212 deadline, relative to the deadline. \u22121 is the release; jobs right of 0 are late. The last '
      + 'class holds all jobs that are later than one whole deadline. Lost jobs have no lateness. Logarithmic.',
    build(t, width) {
      const group = groups[state.executor];
      const byDag = latenessByDag();
      const most = Math.max(...byDag.map((counts) => Math.max(...counts)));
      if (most === 0) return 'No job finished.';
      const used = group.dags.map((dag, d) => ({dag, d})).filter(({d}) => Math.max(...byDag[d]) > 0);
      return {
        grid: {left: 8, right: 24, top: 66, bottom: 32, containLabel: true},
        legend: {},
        tooltip: {trigger: 'item', formatter: (item) => tip([item.seriesName, latenessClass(item.dataIndex), `${formatCount(item.value)} jobs`])},
        xAxis: {
          type: 'category', name: 'lateness / deadline', nameLocation: 'middle', nameGap: 30,
          data: Array.from({length: LATENESS_CLASSES + 1}, (_, i) => (i === LATENESS_CLASSES ? '> 1' : String((i - half) / half))),
          axisTick: {show: false},
          axisLabel: {interval: (i) => i === LATENESS_CLASSES || (i % (width < 500 ? 40 : 20) === 0 && i < LATENESS_CLASSES)},
        },
        yAxis: {type: 'log', min: 0.8, name: 'jobs', nameGap: 24, nameTextStyle: {align: 'left'},
          axisLabel: {formatter: (value) => (value < 1 ? '' : formatCount(value))}},
        series: used.map(({dag, d}, k) => ({
          type: 'bar', name: dag.name, barGap: '-100%', barCategoryGap: '8%', barMinHeight: 1,
          itemStyle: {color: hueOf(t, d).color, opacity: used.length > 1 ? 0.72 : 1},
          data: byDag[d].map((count) => (count === 0 ? null : count)),
          markLine: k === 0 ? {symbol: 'none', silent: true, animation: false, data: [limitLine(t, half, 'deadline')]} : undefined,
        })),
      };
    },
  });
}

const TIMELINE_HEIGHT = 268;
const DEVICE_HEIGHT = 56;  // of a device's part of the timeline
const MOST_DEVICES = 6;    // that the timeline shows; its data have all

/** Draws the whole run: the DAGs that kept the workers busy, the devices in use, and the missed deadlines. */
function timelineFigure(groups, state) {
  const fig = figure({
    name: 'timeline', height: TIMELINE_HEIGHT, label: 'Workers in use and missed deadlines over the whole run', zooms: true,
    data() {
      const {dags, devices, timeline} = groups[state.executor];
      return {
        columns: [column('from'), ...devices.map(({name}) => column(`${name}: in use`, 'Share of its slots')),
          ...dags.flatMap(({name}) => [column(`${name}: workers`), column(`${name}: missed`)])],
        rows: timeline.busy_ns[0].map((_, i) => ({cells: [timeCell(i * timeline.bin_ns),
          ...devices.map(({slots}, d) => ({text: formatPercent(timeline.device_busy_ns[d][i] / slots / timeline.bin_ns), sort: timeline.device_busy_ns[d][i]})),
          ...dags.flatMap((dag, d) => [{text: (timeline.busy_ns[d][i] / timeline.bin_ns).toFixed(2), sort: timeline.busy_ns[d][i]}, shareCell(timeline.missed[d][i], timeline.released[d][i])])]})),
      };
    },
    caption: 'Above: workers in use, by DAG. Below: share of the jobs released in each interval that missed their deadline '
      + 'or were lost. Between them, where there are devices: the share of their slots in use.',
    build(t, width) {
      const group = groups[state.executor];
      const line = group.timeline;
      const devices = group.devices.slice(0, MOST_DEVICES);
      const inUse = (d, i) => line.device_busy_ns[d][i] / devices[d].slots / line.bin_ns;
      const last = 1 + devices.length;  // the grid of the misses
      const down = devices.length * DEVICE_HEIGHT;
      fig.resize(TIMELINE_HEIGHT + down);
      const bins = line.busy_ns[0].length;
      const time = (i) => i * line.bin_ns;
      const workers = group.run.config.workers;
      const axis = (grid, label) => ({
        type: 'value', gridIndex: grid, min: 0, max: time(bins), splitLine: {show: false}, splitNumber: width < 500 ? 3 : 8,
        axisLabel: {show: label, formatter: (value) => formatAxisTime(value, time(bins) / 10)},
      });
      return {
        grid: [{left: 48, right: 16, top: 52, height: 100}, ...devices.map((_, d) => ({left: 48, right: 16, top: 178 + d * DEVICE_HEIGHT, height: DEVICE_HEIGHT - 24})),
          {left: 48, right: 16, top: 182 + down, height: 58}],
        legend: {data: group.dags.map((dag) => dag.name)},
        dataZoom: [{type: 'inside', xAxisIndex: Array.from({length: last + 1}, (_, i) => i), filterMode: 'none', zoomOnMouseWheel: 'ctrl', preventDefaultMouseMove: false}],
        tooltip: {
          trigger: 'axis', axisPointer: {type: 'line', link: [{xAxisIndex: 'all'}]},
          formatter: (items) => {
            const i = items[0].dataIndex;
            return tip([`${formatTime(time(i))} to ${formatTime(time(i + 1))}`, ...devices.map(({name}, d) => `${name}: ${formatPercent(inUse(d, i))} in use`), ...group.dags.map((dag, d) =>
              `${dag.name}: ${(line.busy_ns[d][i] / line.bin_ns).toFixed(2)} workers, ${line.missed[d][i]} of ${line.released[d][i]} missed`)]);
          },
        },
        axisPointer: {link: [{xAxisIndex: 'all'}]},
        xAxis: Array.from({length: last + 1}, (_, i) => axis(i, i === last)),
        yAxis: [
          {type: 'value', gridIndex: 0, min: 0, max: workers, interval: Math.max(1, Math.ceil(workers / 4)), name: 'workers',
            nameTextStyle: {align: 'left'}, nameGap: 8},
          ...devices.map(({name}, d) => ({type: 'value', gridIndex: 1 + d, min: 0, max: 1, interval: 1, name, nameGap: 4, nameTextStyle: {align: 'left'},
            axisLabel: {formatter: (value) => `${100 * value} %`}})),
          {type: 'value', gridIndex: last, min: 0, max: 1, interval: 1, name: 'missed', nameGap: 4, nameTextStyle: {align: 'left'},
            axisLabel: {formatter: (value) => `${100 * value} %`}},
        ],
        series: [
          ...group.dags.map((dag, d) => ({
            type: 'line', name: dag.name, xAxisIndex: 0, yAxisIndex: 0, stack: 'busy', step: 'end', showSymbol: false,
            lineStyle: {width: 0}, areaStyle: {opacity: 0.85}, itemStyle: {color: hueOf(t, d).color},
            data: [...line.busy_ns[d], line.busy_ns[d][bins - 1]].map((busy, i) => [time(i), busy / line.bin_ns]),
          })),
          ...devices.map(({name}, d) => ({
            type: 'line', name, xAxisIndex: 1 + d, yAxisIndex: 1 + d, step: 'end', showSymbol: false,
            lineStyle: {width: 1}, areaStyle: {opacity: 0.4}, itemStyle: {color: t.soft},
            data: Array.from({length: bins + 1}, (_, i) => [time(i), inUse(d, Math.min(i, bins - 1))]),
          })),
          ...group.dags.map((dag, d) => ({
            type: 'line', name: dag.name, xAxisIndex: last, yAxisIndex: last, step: 'end', showSymbol: false,
            lineStyle: {width: 1.5}, areaStyle: {opacity: 0.2}, itemStyle: {color: hueOf(t, d).color},
            data: [...line.missed[d], line.missed[d][bins - 1]].map((missed, i) => [time(i), missed / Math.max(1, line.released[d][i] || 0)]),
          })),
        ],
      };
    },
  });
  return fig;
}

/**
 * Draws one number of every DAG under every executor: as a bar, or on a logarithmic axis, which has no zero, as a dot.
 * `value(row, cell)` returns {at, min, max}, or null without a value; `limit(cell)` the deadline of that number, or null.
 */
function comparisonFigure({name, title, groups, rows, value, limit = () => null, log, format, formatAxis, caption}) {
  const bars = {barGap: '12%', barMaxWidth: 46};
  return figure({
    name, height: 300, label: title, caption,
    data: () => ({
      columns: [column('DAG'), column('executor', '', true), column(title), column('least'), column('most'), column('deadline')],
      rows: rows.flatMap((row) => row.groups.map((cell, g) => {
        const {at, min, max} = value(row, cell) || {at: null, min: null, max: null};
        const shown = (number) => ({text: number === null ? '\u2013' : format(number) || '0', sort: number});
        return {cells: [row.name, groups[g].label, shown(at), shown(min), shown(max), timeCell(limit(cell))]};
      })),
    }),
    build(t, width) {
      const positive = rows.flatMap((row) => row.groups.flatMap((cell) => [(value(row, cell) || {at: 0}).at, limit(cell)])).filter((at) => at > 0);
      if (log && !rows.some((row) => row.groups.some((cell) => value(row, cell) !== null))) return 'No job finished.';
      const floor = log ? 10 ** Math.floor(Math.log10(Math.min(...positive) / 2)) : 0;
      const spread = (row, g) => value(row, row.groups[g]) || {at: null, min: null, max: null};
      const hasLabels = groups.length * rows.length * (log ? 78 : 46) <= width;
      // A line in ink, on a bar of any shade.
      const inked = (shape, style) => [{type: 'line', shape, style: {stroke: t.paper, lineWidth: 4}}, {type: 'line', shape, style: {stroke: t.ink, ...style}}];
      return {
        grid: {left: 8, right: 16, top: 54, bottom: 8, containLabel: true},
        legend: {data: groups.map((group) => group.label)},
        tooltip: {
          trigger: 'item',
          formatter: (item) => {
            const g = item.seriesIndex % groups.length;
            const {at, min, max} = spread(rows[item.dataIndex], g);
            const deadline = limit(rows[item.dataIndex].groups[g]);
            return tip([`${rows[item.dataIndex].name}, ${groups[g].label}`, at === null ? 'no job finished' : format(at),
              min === max ? null : `repetitions: ${format(min)} to ${format(max)}`, deadline === null ? null : `deadline ${formatTime(deadline)}`]);
          },
        },
        xAxis: {type: 'category', data: rows.map((row) => row.name), axisTick: {show: false}, axisLabel: {color: t.ink, interval: 0}},
        yAxis: {
          type: log ? 'log' : 'value', min: floor, max: log ? Math.max(...positive) * 1.6 : undefined, name: title, nameTextStyle: {align: 'left'},
          axisLabel: {formatter: formatAxis, showMaxLabel: log ? false : undefined},
        },
        series: [
          ...(log ? [] : groups.map((group, g) => ({
            type: 'bar', name: group.label, ...bars, itemStyle: {...fillOf(t, shadeOf(t, g)), borderRadius: [3, 3, 0, 0]},
            data: rows.map((row) => spread(row, g).at),
          }))),
          ...groups.map((group, g) => ({
            // The deadline, a line from the lowest to the highest repetition, the dot, and above all of them the number.
            type: 'custom', name: group.label, silent: !log, z: 5, color: shadeOf(t, g).color, data: rows.map((row, i) => [i, spread(row, g).max]),
            encode: {x: 0, y: 1},
            renderItem: (params, api) => {
              const place = api.value(0);
              const {at, min, max} = spread(rows[place], g);
              const layout = api.barLayout({count: groups.length, ...bars})[g];
              const x = api.coord([place, floor || 0])[0] + layout.offsetCenter;
              const y = (number) => api.coord([place, Math.max(number, floor)])[1];
              const children = [];
              const deadline = limit(rows[place].groups[g]);
              if (deadline !== null) {
                const half = layout.width * 0.56;
                children.push(...inked({x1: x - half, x2: x + half, y1: y(deadline), y2: y(deadline)}, {lineWidth: 1.8, lineDash: [5, 3]}));
              }
              if (at !== null && min !== max) {
                const ends = [{x1: x, x2: x, y1: y(max), y2: y(min)}, ...[min, max].map((end) => ({x1: x - 4, x2: x + 4, y1: y(end), y2: y(end)}))];
                children.push(...ends.flatMap((shape) => inked(shape, {lineWidth: 1.2})));
              }
              if (at !== null && log) {
                const {color, pattern} = shadeOf(t, g);
                children.push({type: 'circle', shape: {cx: x, cy: y(at), r: 5}, style: {fill: pattern === 'none' ? color : t.paper, stroke: color, lineWidth: 2.5}});
              }
              if (at !== null && hasLabels) {
                children.push({type: 'text', silent: true, style: {text: format(at), x, y: y(max) - 8, align: 'center', verticalAlign: 'bottom', fontSize: 11, fill: t.soft,
                  stroke: t.paper, lineWidth: 3}});
              }
              return children.length === 0 ? null : {type: 'group', children};
            },
          })),
        ],
      };
    },
  });
}
