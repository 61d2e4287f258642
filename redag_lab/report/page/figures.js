// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Figures of many jobs: distributions of responses, and executors side by side.

const MOST_LINES = 24;  // that a figure can show legibly

const taskName = (group, task) => `${group.dags[group.tasks[task].dag].name}.${group.tasks[task].name}`;
const hasCurve = (task) => task.responses !== undefined && task.responses.value_ns.length > 0;

/**
 * Returns the share of jobs that had finished by each time. Lost jobs never finish, and jobs in progress at the end are
 * left out.
 */
function distribution(task, scale, tail) {
  const {missed, finished, late} = task.jobs;
  const awaited = missed + finished - late;  // finished, lost or overdue
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
          type: 'value', name: one ? 'response' : 'response / deadline', nameLocation: 'middle', nameGap: 32,
          min: 0, max: Math.max(most, edge) * 1.03,
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

/**
 * Draws a number of several things, in several series: as bars, or on a logarithmic axis, which has no zero, as dots.
 * `data()` returns {names, series, title, log, format, formatAxis, none}. A series has a name and, for each thing, {at,
 * min, max}; numbers can be null. `none` is said where no number is known.
 */
function comparisonFigure({name, label, caption, data}) {
  const bars = {barGap: '12%', barMaxWidth: 46};
  return figure({
    name, height: 300, label, caption,
    build(t, width) {
      const {names, series, title, log, format, formatAxis, none} = data();
      const all = series.flatMap(({values}) => values);
      if (all.every(({at}) => at === null)) return none;
      const positive = all.map(({at}) => at).filter((number) => number > 0);
      const floor = log ? 10 ** Math.floor(Math.log10(Math.min(...positive) / 2)) : 0;
      const hasLabels = series.length * names.length * (log ? 78 : 46) <= width;
      // A line in ink, on a bar of any shade.
      const inked = (shape, style) => [{type: 'line', shape, style: {stroke: t.paper, lineWidth: 4}}, {type: 'line', shape, style: {stroke: t.ink, ...style}}];
      return {
        grid: {left: 8, right: 16, top: 54, bottom: 8, containLabel: true},
        legend: series.length > 1 ? {data: series.map((one) => one.name)} : undefined,
        tooltip: {
          trigger: 'item',
          formatter: ({dataIndex, seriesIndex}) => {
            const one = series[seriesIndex % series.length];
            const {at, min, max} = one.values[dataIndex];
            return tip([`${names[dataIndex]}, ${one.name}`, at === null ? none : format(at), min === max ? null : `${format(min)} to ${format(max)}`]);
          },
        },
        xAxis: {type: 'category', data: names, axisTick: {show: false}, axisLabel: {color: t.ink, interval: 0, rotate: names.length * 62 > width ? 35 : 0}},
        yAxis: {
          type: log ? 'log' : 'value', min: log ? floor : undefined, max: log ? Math.max(...positive) * 1.6 : undefined, name: title, nameTextStyle: {align: 'left'},
          axisLabel: {formatter: formatAxis, showMaxLabel: log ? false : undefined},
        },
        series: [
          ...(log ? [] : series.map((one, s) => ({
            type: 'bar', name: one.name, ...bars, itemStyle: {...fillOf(t, shadeOf(t, s)), borderRadius: [3, 3, 0, 0]}, data: one.values.map(({at}) => at),
          }))),
          ...series.map((one, s) => ({
            // A line from the lowest to the highest repetition, the dot, and above them the number.
            type: 'custom', name: one.name, silent: !log, z: 5, color: shadeOf(t, s).color, data: one.values.map(({max}, i) => [i, max]), encode: {x: 0, y: 1},
            renderItem: (params, api) => {
              const {at, min, max} = one.values[api.value(0)];
              if (at === null) return null;
              const layout = api.barLayout({count: series.length, ...bars})[s];
              const y = (number) => api.coord([0, log ? Math.max(number, floor) : number])[1];
              const x = api.coord([api.value(0), floor])[0] + layout.offsetCenter;
              const children = [];
              if (min !== max) {
                const ends = [{x1: x, x2: x, y1: y(max), y2: y(min)}, ...[min, max].map((end) => ({x1: x - 4, x2: x + 4, y1: y(end), y2: y(end)}))];
                children.push(...ends.flatMap((shape) => inked(shape, {lineWidth: 1.2})));
              }
              const {color, pattern} = shadeOf(t, s);
              if (log) children.push({type: 'circle', shape: {cx: x, cy: y(at), r: 5}, style: {fill: pattern === 'none' ? color : t.paper, stroke: color, lineWidth: 2.5}});
              if (hasLabels) {
                children.push({type: 'text', silent: true, style: {text: format(at), x, y: y(max) - 8, align: 'center', verticalAlign: 'bottom', fontSize: 11, fill: t.soft,
                  stroke: t.paper, lineWidth: 3}});
              }
              return {type: 'group', children};
            },
          })),
        ],
      };
    },
  });
}
