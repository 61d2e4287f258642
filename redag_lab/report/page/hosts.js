// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Chains over hosts, of a merged run. The clocks leave bounds of each latency: a figure shows them as a band, and a
// deadline within the band is one of which nothing can be told.

const VERDICTS = {met: 'met', missed: 'missed', unknown: 'cannot be told'};

/** "12.3 ms to 12.5 ms". */
const formatRange = ({low_ns: low, high_ns: high}) => (formatTime(low) === formatTime(high) ? formatTime(low) : `${formatTime(low)} to ${formatTime(high)}`);

const offsetCell = ({low_ns: low, high_ns: high}) => ({
  text: `${formatTime((low + high) / 2)} \u00b1 ${formatTime((high - low) / 2)}`, sort: (low + high) / 2,
});

function hostTable({hosts}) {
  const columns = [
    column('host'), column('offset at the start', 'The host\u2019s clock minus the common clock, and how certain it is'), column('at the end'),
    column('times within', 'The most by which a time of this host is wrong on this page'), column('known by', '', true),
  ];
  return table('Hosts', columns, hosts.map((host) => ({cells: [host.name, offsetCell(host.offset_at_start), offsetCell(host.offset_at_end),
    timeCell(host.within_ns), {text: host.clock}]})));
}

function chainTable({chains}) {
  const columns = [
    column('chain'), column('deadline', 'From the release of the first source'), column('answers', 'Jobs of the last task whose first source is known'),
    column('met', 'Within the deadline, whatever the clocks were'), column('missed', 'Beyond the deadline, whatever the clocks were'),
    column('cannot be told', 'The deadline is within the uncertainty of the clocks'), column('longest'), column('shortest'),
    column('uncertain', 'The widest bounds of an answer'),
  ];
  const verdict = (chain, name, kind) => (chain.deadline_ns === null ? {text: '\u2013', sort: null}
    : shareCell(chain[name], chain.answers, {kind: chain[name] > 0 ? kind : ''}));
  const range = (chain, name) => (chain.answers === 0 ? {text: '\u2013', sort: null} : {text: formatRange(chain[name]), sort: chain[name].high_ns});
  return table('Chains over hosts', columns, chains.map((chain) => ({cells: [
    {text: element('span', {}, ...breakable(chain.name))}, timeCell(chain.deadline_ns), countCell(chain.answers),
    verdict(chain, 'met', ''), verdict(chain, 'missed', 'missed'), verdict(chain, 'unknown', ''),
    range(chain, 'longest'), range(chain, 'shortest'), timeCell(chain.answers === 0 ? null : chain.widest_ns),
  ]})));
}

function worstTable(chain) {
  const columns = [column('answer', 'Number of the job of the last task'), column('finished after', 'Since the start of the run'), column('at least'), column('at most'),
    column('deadline')];
  return table('The longest answers', columns, chain.worst.map((answer) => ({cells: [
    {text: `#${answer.job}`, sort: answer.job}, timeCell(answer.finish_ns), timeCell(answer.low_ns), timeCell(answer.high_ns),
    {text: answer.verdict === null ? '\u2013' : VERDICTS[answer.verdict], kind: answer.verdict === 'missed' ? 'missed' : ''},
  ]})), {most: 12});
}

/** Returns the corners of a distribution: a step at each value. */
function steps({value_ns: values, count}, whole) {
  const corners = [];
  let share = 0;
  values.forEach((ns, i) => {
    corners.push([ns, share]);
    share = count[i] / Math.max(1, whole);
    corners.push([ns, share]);
  });
  return corners;
}

function chainFigure(part, chosen) {
  const chain = () => part.chains[chosen()];
  return figure({
    name: 'chains', height: 340, label: 'Latency of a chain over hosts',
    caption: 'Band: where the share of answers within a latency lies, by what is known of the clocks. The left edge has the lower '
      + 'bounds of the latencies, the right edge the upper ones. Dashed: the deadline. Answers whose bounds are left of it met it, those right of it '
      + 'missed it.',
    data: () => ({
      columns: [column('share of answers'), column('latency at least'), column('at most')],
      rows: [0, 0.5, 0.9, 0.99, 1].map((share) => {
        const value = ({value_ns: values, count}) => values[count.findIndex((jobs) => jobs >= share * chain().drawn)];
        return {cells: [{text: formatPercent(share), sort: share}, timeCell(value(chain().low)), timeCell(value(chain().high))]};
      }),
    }),
    build(t, width) {
      if (chain().answers === 0) return 'No answer of this chain was recorded.';
      const {drawn, deadline_ns: deadline} = chain();
      const [low, high] = [steps(chain().low, drawn), steps(chain().high, drawn)];
      const first = Math.min(low[0][0], deadline ?? low[0][0]);
      const last = Math.max(high[high.length - 1][0], deadline ?? 0);
      const margin = Math.max(1, 0.06 * (last - first));
      const edge = (name, data, dash) => ({
        type: 'line', name, data, showSymbol: false, lineStyle: {width: 1.6, type: dash, color: hueOf(t, 0).color}, itemStyle: {color: hueOf(t, 0).color},
      });
      const marks = deadline === null ? [] : [limitLine(t, deadline, 'deadline')];
      return {
        grid: {left: 8, right: 24, top: 66, bottom: 34, containLabel: true},
        legend: {},
        tooltip: {trigger: 'item', formatter: (item) => tip([item.seriesName, formatTime(item.value[0]), `${formatPercent(item.value[1])} of the answers`])},
        xAxis: {
          type: 'value', name: 'latency', nameLocation: 'middle', nameGap: 32, min: first - margin, max: last + margin, splitNumber: width < 500 ? 3 : 6,
          axisLabel: {showMinLabel: false, showMaxLabel: false, formatter: (ns) => formatAxisTime(ns, (last - first) / 20)},
        },
        yAxis: {type: 'value', min: 0, max: 1, name: 'share of answers', nameGap: 24, nameTextStyle: {align: 'left'}},
        series: [
          {
            type: 'custom', name: 'uncertain', silent: true, itemStyle: {color: hueOf(t, 0).color}, data: [[first, 0]],
            renderItem: (params, api) => ({
              type: 'polygon', shape: {points: [...low, ...[...high].reverse()].map((corner) => api.coord(corner))},
              style: {fill: hueOf(t, 0).color, opacity: 0.28},
            }),
          },
          {...edge('at least', low, 'solid'), markLine: {symbol: 'none', silent: true, animation: false, data: marks}},
          edge('at most', high, [3, 3]),
        ],
      };
    },
  });
}

/** Returns the section of a merged run; nothing for a run of one host. */
function hostsSection(part) {
  if (!part) return [];
  const nodes = [heading(2, 'hosts', 'Hosts and their clocks'), filled(() => hostTable(part))];
  if (part.chains.length === 0) return nodes;
  let chosen = 0;
  const latencies = chainFigure(part, () => chosen);
  return [
    ...nodes, heading(2, 'chains', 'Chains over hosts'), filled(() => chainTable(part)),
    element('div.row.controls', {}, dropdown('chain', part.chains.map(({name}) => name), 0, (i) => {
      chosen = i;
      refill();
      latencies.draw();
    })),
    latencies.box, filled(() => worstTable(part.chains[chosen])),
  ];
}
