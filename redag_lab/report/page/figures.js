// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Figures of many jobs: distributions of responses, lateness, the whole run, and executors side by side.

const LATENESS_CLASSES = 80;  // on [-1, 1) deadlines; the last count holds all larger values

const MOST_LINES = 24;        // that a figure can show legibly

const taskName = (group, task) => `${group.dags[group.tasks[task].dag].name}.${group.tasks[task].name}`;
const hasCurve = (task) => task.responses !== undefined && task.responses.value_ns.length > 0;

/**
 * Returns the share of jobs that had finished by each time. Lost jobs never finish, and jobs in progress at the end are
 * left out.
 */
function distribution(task, scale, tail) {
  const jobs = task.jobs;
  const awaited = jobs.missed + jobs.finished - jobs.late;  // finished, lost or overdue
  const points = task.responses.value_ns.map((ns, i) => {
    const share = task.responses.count[i] / Math.max(1, awaited);
    return [ns / scale, tail ? 1 - share : share];
  });
  const first = [points[0][0], tail ? 1 : 0];
  // A logarithmic axis has no zero: the curve ends where no job is slower.
  return [first, ...points].filter(([, share]) => !tail || share > 1e-12);
}

function verticalLine(t, x, text, colour, position) {
  return {
    xAxis: x, lineStyle: {color: colour, type: 'dashed', width: 1.5}, symbol: 'none',
    label: {formatter: () => text, color: colour, position: position || 'end', distance: 4},
  };
}

/**
 * Draws response times: of one task under every executor, with deadline and bounds, or of all tasks of one executor,
 * each as a share of its deadline.
 */
function responseFigure(groups, state) {
  return figure({
    name: 'responses', height: 368, label: 'Distribution of response times',
    caption: 'Response time: finish \u2212 nominal release. Lost jobs never finish: a task with lost jobs has a '
      + `curve that ends below 1. At most ${MOST_LINES} tasks are shown, the closest to their deadlines. Click the legend to hide or show a line.`,
    build(t, width) {
      const one = state.task !== null;
      const name = one ? taskName(groups[state.executor], state.task) : null;
      const lines = [];
      groups.forEach((group, g) => {
        if (!one && g !== state.executor) return;
        group.tasks.forEach((task, i) => {
          if (!hasCurve(task) || (one && taskName(group, i) !== name)) return;
          lines.push({group, g, task, i});
        });
      });
      if (lines.length > MOST_LINES) {
        const closeness = ({task}) => task.jobs.response.max_ns / task.deadline_ns;
        lines.sort((a, b) => closeness(b) - closeness(a)).splice(MOST_LINES);
      }
      if (lines.length === 0) return 'No job of this task finished.';
      const mark = one ? groups[state.executor].tasks[state.task] : null;
      const marks = one
        ? [verticalLine(t, mark.deadline_ns, 'deadline', t.bad),
          ...(mark.bound_ns === null ? [] : [verticalLine(t, mark.bound_ns, 'bound', t.good, 'insideEndTop')])]
        : [verticalLine(t, 1, 'deadline', t.bad)];
      const most = Math.max(...lines.map(({task}) => task.responses.value_ns[task.responses.value_ns.length - 1]
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
        series: lines.map(({group, g, task, i}, k) => ({
          type: 'line', name: one ? group.label : taskName(group, i), step: 'end', showSymbol: false, symbolSize: 8,
          triggerLineEvent: true, data: distribution(task, one ? 1 : task.deadline_ns, state.tail),
          lineStyle: {width: 2, type: one ? 'solid' : ['solid', 'dashed', 'dotted'][Math.floor(i / 8) % 3]},
          itemStyle: {color: colourOf(t, one ? g : i)},
          markLine: k === 0 ? {symbol: 'none', silent: true, data: marks, animation: false} : undefined,
        })),
      };
    },
  });
}

/** Draws how early or late jobs finished, in classes of 1/40 of the deadline. */
function latenessFigure(groups, state) {
  return figure({
    name: 'lateness', height: 308, label: 'Histogram of lateness',
    caption: 'Lateness: finish \u2212 deadline, relative to the deadline. \u22121 is the release; jobs right of 0 are late. The last '
      + 'class holds all jobs that are later than one whole deadline. Lost jobs have no lateness. Logarithmic.',
    build(t, width) {
      const group = groups[state.executor];
      const tasks = state.task !== null ? [group.tasks[state.task]] : group.tasks;
      const byDag = group.dags.map(() => new Array(LATENESS_CLASSES + 1).fill(0));
      tasks.forEach((task) => (task.lateness || []).forEach((count, i) => { byDag[task.dag][i] += count; }));
      const most = Math.max(...byDag.map((counts) => Math.max(...counts)));
      if (most === 0) return 'No job finished.';
      const half = LATENESS_CLASSES / 2;
      const bounds = (i) => (i === LATENESS_CLASSES ? 'more than one deadline late'
        : `${((i - half) / half).toFixed(3)} to ${((i + 1 - half) / half).toFixed(3)} of the deadline`);
      const used = group.dags.map((dag, d) => ({dag, d})).filter(({d}) => Math.max(...byDag[d]) > 0);
      return {
        grid: {left: 8, right: 24, top: 66, bottom: 32, containLabel: true},
        legend: {},
        tooltip: {trigger: 'item', formatter: (item) => tip([item.seriesName, bounds(item.dataIndex), `${formatCount(item.value)} jobs`])},
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
          itemStyle: {color: colourOf(t, d), opacity: used.length > 1 ? 0.72 : 1},
          data: byDag[d].map((count) => (count === 0 ? null : count)),
          markLine: k === 0 ? {symbol: 'none', silent: true, animation: false, data: [{
            xAxis: half, lineStyle: {color: t.bad, type: 'dashed', width: 1.5},
            label: {formatter: () => 'deadline', color: t.bad, position: 'end'}}]} : undefined,
        })),
      };
    },
  });
}

/** Draws the whole run: the DAGs that kept the workers busy, and the missed deadlines. */
function timelineFigure(groups, state) {
  return figure({
    name: 'timeline', height: 268, label: 'Workers in use and missed deadlines over the whole run',
    caption: 'Above: workers in use, by DAG. Below: share of the jobs released in each interval that missed their deadline '
      + 'or were lost.',
    build(t, width) {
      const group = groups[state.executor];
      const line = group.timeline;
      const bins = line.busy_ns[0].length;
      const time = (i) => i * line.bin_ns;
      const workers = group.run.config.workers;
      const axis = (grid, label) => ({
        type: 'value', gridIndex: grid, min: 0, max: time(bins), splitLine: {show: false}, splitNumber: width < 500 ? 3 : 8,
        axisLabel: {show: label, formatter: (value) => formatAxisTime(value, time(bins) / 10)},
      });
      return {
        grid: [{left: 48, right: 16, top: 52, height: 100}, {left: 48, right: 16, top: 182, height: 58}],
        legend: {data: group.dags.map((dag) => dag.name)},
        dataZoom: [{type: 'inside', xAxisIndex: [0, 1], filterMode: 'none', zoomOnMouseWheel: 'ctrl', preventDefaultMouseMove: false}],
        tooltip: {
          trigger: 'axis', axisPointer: {type: 'line', link: [{xAxisIndex: 'all'}]},
          formatter: (items) => {
            const i = items[0].dataIndex;
            return tip([`${formatTime(time(i))} to ${formatTime(time(i + 1))}`, ...group.dags.map((dag, d) =>
              `${dag.name}: ${(line.busy_ns[d][i] / line.bin_ns).toFixed(2)} workers, ${line.missed[d][i]} of ${line.released[d][i]} missed`)]);
          },
        },
        axisPointer: {link: [{xAxisIndex: 'all'}]},
        xAxis: [axis(0, false), axis(1, true)],
        yAxis: [
          {type: 'value', gridIndex: 0, min: 0, max: workers, interval: Math.max(1, Math.ceil(workers / 4)), name: 'workers',
            nameTextStyle: {align: 'left'}, nameGap: 8},
          {type: 'value', gridIndex: 1, min: 0, max: 1, interval: 1, name: 'missed', nameGap: 4, nameTextStyle: {align: 'left'},
            axisLabel: {formatter: (value) => `${100 * value} %`}},
        ],
        series: [
          ...group.dags.map((dag, d) => ({
            type: 'line', name: dag.name, xAxisIndex: 0, yAxisIndex: 0, stack: 'busy', step: 'end', showSymbol: false,
            lineStyle: {width: 0}, areaStyle: {opacity: 0.85}, itemStyle: {color: colourOf(t, d)},
            data: [...line.busy_ns[d], line.busy_ns[d][bins - 1]].map((busy, i) => [time(i), busy / line.bin_ns]),
          })),
          ...group.dags.map((dag, d) => ({
            type: 'line', name: dag.name, xAxisIndex: 1, yAxisIndex: 1, step: 'end', showSymbol: false,
            lineStyle: {width: 1.5}, areaStyle: {opacity: 0.2}, itemStyle: {color: colourOf(t, d)},
            data: [...line.missed[d], line.missed[d][bins - 1]].map((missed, i) => [time(i), missed / Math.max(1, line.released[d][i] || 0)]),
          })),
        ],
      };
    },
  });
}

/**
 * Draws one number of every DAG under every executor. `value(row, cell)` returns {at, min, max}, or null without a
 * value.
 */
function comparisonFigure({name, title, groups, rows, value, log, format, formatAxis, caption}) {
  return figure({
    name, height: 300, label: title, caption,
    build(t, width) {
      const positive = rows.flatMap((row) => row.groups.map((cell) => value(row, cell))).filter((v) => v !== null && v.at > 0).map((v) => v.at);
      if (log && positive.length === 0) return 'No job finished.';
      const floor = log ? 10 ** Math.floor(Math.log10(Math.min(...positive) / 2)) : 0;
      const spread = (row, g) => value(row, row.groups[g]) || {at: null, min: null, max: null};
      return {
        grid: {left: 8, right: 16, top: 54, bottom: 8, containLabel: true},
        legend: {},
        tooltip: {
          trigger: 'item',
          formatter: (item) => {
            const {at, min, max} = spread(rows[item.dataIndex], item.seriesIndex % groups.length);
            return tip([`${rows[item.dataIndex].name}, ${groups[item.seriesIndex % groups.length].label}`, at === null ? 'no job finished' : format(at),
              min === max ? null : `repetitions: ${format(min)} to ${format(max)}`]);
          },
        },
        xAxis: {type: 'category', data: rows.map((row) => row.name), axisTick: {show: false}, axisLabel: {color: t.ink, interval: 0}},
        yAxis: {
          type: log ? 'log' : 'value', min: log ? floor : 0, name: title, nameTextStyle: {align: 'left'},
          axisLabel: {formatter: formatAxis},
        },
        series: [
          ...groups.map((group, g) => ({
            type: 'bar', name: group.label, barGap: '12%', barMaxWidth: 46, itemStyle: {color: colourOf(t, g), borderRadius: [3, 3, 0, 0]},
            data: rows.map((row) => spread(row, g).at),
            label: {show: groups.length * rows.length * (log ? 78 : 60) <= width, position: 'top', color: t.soft, fontSize: 11, distance: 6,
              formatter: (item) => format(item.value)},
          })),
          ...groups.map((group, g) => ({
            // A line from the lowest to the highest repetition, over the executor's bar.
            type: 'custom', name: group.label, silent: true, z: 5, data: rows.map((row, i) => [i, spread(row, g).min, spread(row, g).max]),
            renderItem: (params, api) => {
              const low = api.value(1);
              const high = api.value(2);
              if (low === high) return null;
              const layout = api.barLayout({count: groups.length, barGap: '12%', barMaxWidth: 46})[g];
              const x = api.coord([api.value(0), high])[0] + layout.offsetCenter;
              const top = api.coord([api.value(0), high])[1];
              const bottom = api.coord([api.value(0), Math.max(low, floor)])[1];
              const stroke = {stroke: t.ink, lineWidth: 1.2};
              const bar = (y) => ({type: 'line', shape: {x1: x - 4, x2: x + 4, y1: y, y2: y}, style: stroke});
              return {type: 'group', children: [{type: 'line', shape: {x1: x, x2: x, y1: top, y2: bottom}, style: stroke}, bar(top), bar(bottom)]};
            },
          })),
        ],
      };
    },
  });
}
