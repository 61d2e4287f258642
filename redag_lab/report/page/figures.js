// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Figures of many jobs: executors side by side.

const taskName = (group, task) => `${group.dags[group.tasks[task].dag].name}.${group.tasks[task].name}`;

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
